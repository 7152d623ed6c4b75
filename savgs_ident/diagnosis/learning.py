"""Flexible members as hypotheses: a learned law at a port, fitted on the true, nonlinear plant.

Localisation learns a law to first order about the baseline. Here the same functions of what the port sees become part
of the model (:mod:`savgs_ident.effects.learned`), and their coefficients are fitted beside the baseline's own
parameters, as those of any effect: with a prior, a null and an evidence. So the law can be weighed against the
catalogue's formulas, solved, simulated and exported.

Which family the law is of follows from the fit: its functions of all other families are taken away, to first order
about the fit, and what remains is weighed. The best family is fitted again by itself; where its functions alone are
more probable than all together, the law is made of them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.diagnosis.held_out import HeldOut, hold_out
from savgs_ident.diagnosis.localisation import widths_of
from savgs_ident.diagnosis.problem import AbstractProblem, term_of
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Family, Port
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import coefficients_at, coefficients_of, functions_at, learned_effect
from savgs_ident.inference.find_map import (
    LaplaceFit,
    Search,
    find_map,
    linearised_optimum,
    log_evidence,
    search_of,
)
from savgs_ident.inference.observations import Data, Term
from savgs_ident.inference.prior import Linear, bounds_of

STEPS = 20
"""Most steps of the fit."""

SEEN = 1e-3
"""A function of unit size that changes the rows by less than this share of what another one does is left out.

Data that hardly see a function, as a constant force, would let its coefficient be of any size.
"""


@dataclass(frozen=True)
class LearnedLaw:
    """A law at its best, beside the baseline.

    Attributes:
        name: of the effect.
        port: where it acts.
        term: its coefficients as a search takes them.
        problem: the baseline with the law as its only candidate.
        search: that, and the data.
        mode: the best point of both.
        spans: the range of the port's signals that it knows, by name, SI.
        families: log evidence of the functions of each family alone, to first order about the best point.
    """

    name: str
    port: Port
    term: Term
    problem: AbstractProblem
    search: Search
    mode: LaplaceFit
    spans: Mapping[str, float]
    families: Mapping[Family, float]

    @property
    def effect(self) -> Effect:
        """The law as an effect of a model."""
        return self.problem.catalogue[self.name]

    @property
    def units(self) -> dict[str, str]:
        """The coefficients of all its functions, those that it does not have among them, with their units."""
        coefficients = coefficients_at(self.port)
        return {each.name: each.unit for each in self.effect.parameters if each.name in coefficients}

    @property
    def values(self) -> dict[str, float]:
        """All its numbers, and those of the plant that were fitted beside it, SI."""
        return dict.fromkeys(self.units, 0.0) | self.mode.values | dict(self.spans)

    @property
    def identified(self) -> float:
        """How many coefficients the data identify: the share of each one's prior variance that they took away."""
        coefficients = {each.name for each in self.term.amplitudes}
        mine = np.array([each.name in coefficients for each in self.mode.coordinates])
        return float(np.sum(1.0 - np.diag(self.mode.covariance())[mine]))

    @property
    def family(self) -> Family:
        """The family that explains most."""
        return max(self.families, key=lambda family: self.families[family])

    def held_out(self, constants: DecisionConstants = DEFAULTS) -> HeldOut:
        """What it predicts of tests left out."""
        return hold_out(self.search, self.mode, (self.term,), constants)


def learn(
    problem: AbstractProblem,
    data: Data,
    base: LaplaceFit,
    port: Port,
    constants: DecisionConstants = DEFAULTS,
) -> LearnedLaw | None:
    """The law at a port; ``base`` is the recalibrated baseline. None where nothing can be learned.

    Look at the status of its mode.
    """
    spans = problem.learned_spans(port, base.values, base.prediction.warm_start)
    if spans is None:
        return None
    effect = learned_effect(port)
    there = {name: each for name, each in problem.catalogue.items() if name in problem.baseline}
    table = ParameterTable(effect.parameters).with_values(spans)
    mine = replace(
        problem,
        parameters=merge_parameters(problem.parameters, table),
        catalogue={**there, effect.name: effect},
    ).uncorrected()
    search, names = search_of(mine, data), coefficients_at(port)
    start = base.prediction.warm_start
    there_now = mine.predict((effect.name,), base.values, names, start)
    if not there_now.solved:
        return None
    shapes = tuple(each for each in term_of(effect, constants).shapes if each.name not in spans)
    blank = Term(effect.name, port.location, (), shapes)
    columns = dict(zip(names, there_now.slopes.T, strict=True))
    term = _with_amplitudes(blank, effect, search, base, columns, constants)
    mode = find_map(search, (term,), base.values, there_now.warm_start, STEPS)
    law = LearnedLaw(effect.name, port, term, mine, search, mode, spans, {})
    if not mode.solved:
        return law
    found = _families(search, mode, port)
    law = replace(law, families={family: each.evidence for family, each in found.items()})
    kept = {name: columns[name] for name in coefficients_of(port, law.family)}
    alone = _with_amplitudes(blank, effect, search, base, kept, constants)
    return _of_one_family(law, alone, found[law.family].start)


def _with_amplitudes(
    term: Term,
    effect: Effect,
    search: Search,
    base: LaplaceFit,
    columns: Mapping[str, NDArray[np.float64]],
    constants: DecisionConstants,
) -> Term:
    """The term with coefficients whose prior is as wide as to first order about the baseline explains most.

    ``columns`` are the change of the rows (m,) per unit of each, by name; what the data hardly see is left out.
    """
    size = {name: float(np.linalg.norm(column)) for name, column in columns.items()}
    seen = [name for name in columns if size[name] > SEEN * max(size.values())]
    widths = widths_of(search, base, np.stack([columns[name] for name in seen], axis=1), constants)
    units = {each.name: each.unit for each in effect.parameters}
    amplitudes = tuple(
        Linear(name, units[name], 0.0, float(width)) for name, width in zip(seen, widths, strict=True)
    )
    return replace(term, amplitudes=amplitudes)


def _of_one_family(law: LearnedLaw, term: Term, start: Mapping[str, float]) -> LearnedLaw:
    """The law with the functions of its best family alone, those of ``term``, where that is more probable.

    It is looked for from ``start`` [SI], by name.
    """
    alone = find_map(law.search, (term,), start, law.mode.prediction.warm_start, STEPS)
    if not alone.solved or alone.evidence <= law.mode.evidence:
        return law
    families = {**law.families, law.family: alone.evidence}
    return replace(law, term=term, mode=alone, families=families)


class _FamilyAlone(NamedTuple):
    """The functions of one family without those of the others: log evidence, and the best point [SI], by name."""

    evidence: float
    start: Mapping[str, float]


def _families(search: Search, mode: LaplaceFit, port: Port) -> dict[Family, _FamilyAlone]:
    """Each family's functions without those of the others, to first order about the fit."""
    names = [each.name for each in mode.coordinates]
    of_all = set(coefficients_at(port))
    found = {}
    for family in dict.fromkeys(each.family for each in functions_at(port)):
        mine = set(coefficients_of(port, family))
        kept = np.array([name in mine or name not in of_all for name in names])
        found[family] = _alone(search, mode, kept)
    return found


def _alone(search: Search, mode: LaplaceFit, kept: NDArray[np.bool_]) -> _FamilyAlone:
    """The fit with the coordinates that are not ``kept`` (n,) at zero, to first order."""
    missed, slopes = search.missed(mode.prediction), search.turned(mode.slopes)
    coordinates = tuple(each for each, keep in zip(mode.coordinates, kept, strict=True) if keep)
    without = missed + slopes[:, ~kept] @ mode.x[~kept]
    top = linearised_optimum(search.rows, without, slopes[:, kept], mode.x[kept], bounds_of(coordinates))
    start = {each.name: each.value(float(x)) for each, x in zip(coordinates, top.x, strict=True)}
    return _FamilyAlone(log_evidence(top.value, top.precision, coordinates), start)
