"""What matters: changes of the response that something missing makes, against the size from which they count.

What explains some part of the data, but does less to the response than the material size, is not reported missing.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.evidence import DiagnosisProblem, FlexibleMember
from savgs_ident.diagnosis.findings import Findings, hypothesis_of
from savgs_ident.diagnosis.learning import LearnedLaw
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.score_test import Amplitudes
from savgs_ident.diagnosis.verdict import Change, without_immaterial_members
from savgs_ident.inference.background.shared_errors import relative_change
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit


def immaterial(
    problem: DiagnosisProblem, findings: Findings, members: Sequence[FlexibleMember]
) -> Mapping[Hypothesis, float]:
    """By hypothesis, the probability that it changes the response by too little to matter, if it is right.

    Of what was fitted, at its best; of what was only scored, over all sizes that the data leave, so that an effect
    which these tests do not see counts in full.
    """
    constants, base = problem.constants, problem.base
    fits = [(hypothesis_of(mode), mode) for mode in findings.modes]
    fits += [(each.hypothesis, each.law.mode) for each in members]

    def matters(mode: LaplaceFit) -> bool:
        return change_of(problem, mode.prediction.rows - base.prediction.rows).matters(constants)

    found = {
        Hypothesis((score.term.name,)): _chance_of_little(problem, score.amplitudes)
        for score in findings.scores
        if score.amplitudes is not None
    }
    return found | {each: float(not matters(mode)) for each, mode in fits}


SIZES = 100
"""Draws of an effect's size over which it is averaged whether it matters."""


def _chance_of_little(problem: DiagnosisProblem, amplitudes: Amplitudes) -> float:
    """The probability [1] that an effect which was only scored changes the response by too little to matter."""
    changes = _changes(problem, amplitudes.draws(SIZES))
    return float(np.mean([not each.matters(problem.constants) for each in changes]))


def material(problem: DiagnosisProblem, findings: Findings) -> Findings:
    """The findings less those that need an effect which does too little to matter."""

    def without(mode: LaplaceFit, gone: Sequence[str]) -> LaplaceFit:
        terms = problem.terms(Hypothesis(tuple(name for name in mode.terms if name not in gone)))
        return find_map(problem.search, terms, mode.values, mode.prediction.warm_start)

    return without_immaterial_members(
        findings, lambda mode, gone: change_without(problem, mode, gone), without, problem.constants
    )


def change_without(problem: DiagnosisProblem, mode: LaplaceFit, gone: Sequence[str]) -> Change:
    """What some terms of a hypothesis do to the response, all other parameters as they are.

    In the channel where they do most; infinite where the plant has no solution without them.
    """
    if not gone:
        return Change(0.0, 0.0)
    plant = problem.plant
    left = tuple(name for name in mode.terms if name not in gone)
    wanted = [each.name for each in plant.nuisances]
    taken = {each.name for name in gone for each in plant.catalogue[name].parameters}
    values = {name: value for name, value in mode.values.items() if name not in taken or name in wanted}
    without = plant.predict(left, values, wanted, problem.base.prediction.warm_start)
    if not without.solved:
        return Change(np.inf, np.inf)
    return change_of(problem, mode.prediction.rows - without.rows)


def change_by_law(problem: DiagnosisProblem, law: LearnedLaw) -> Change:
    """What a learned law does to the response, all other parameters as they are beside it; infinite as above."""
    plant = problem.plant
    # What a contact is given, the model with the law may not have: it stays as on the sheet.
    known = law.mode.values
    values = {each.name: known[each.name] for each in plant.nuisances if each.name in known}
    without = plant.predict((), values, (), problem.base.prediction.warm_start)
    if not without.solved:
        return Change(np.inf, np.inf)
    return change_of(problem, law.mode.prediction.rows - without.rows)


def change_by_tolerances(problem: DiagnosisProblem, off: Mapping[str, float]) -> Change:
    """What numbers ``off`` their sheet by so many tolerances [1], by name, do to the response, to first order."""
    base = problem.base
    x = np.array([off.get(each.name, 0.0) for each in base.coordinates])
    return change_of(problem, base.slopes @ x)


def change_of(problem: DiagnosisProblem, rows: NDArray[np.float64]) -> Change:
    """A change of the rows (m,), in the channel where it is greatest."""
    return _changes(problem, rows[:, None])[0]


def _changes(problem: DiagnosisProblem, rows: NDArray[np.float64]) -> list[Change]:
    """Changes of the rows (m, changes), each in the channel where it is greatest."""
    channel, data = problem.plant.channel, problem.data
    in_one_test = relative_change(data, channel * data.tests + data.test, rows)
    overall = relative_change(data, channel, rows)
    return [Change(*each) for each in zip(overall.tolist(), in_one_test.tolist(), strict=True)]
