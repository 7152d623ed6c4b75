"""Model selection: the baseline recalibrated, hypotheses and ports compared, and what kind of verdict they allow.

Four stages, each of which returns a whole record:

1. :func:`recalibrate`: the baseline at its own best, a :class:`DiagnosisProblem`.
2. :func:`select_model`: all hypotheses fitted and weighed, what a law at each port would explain, and the kind of the
   verdict, a :class:`DiagnosisEvidence`.
3. Where something unknown is most probable, that evidence seen beside the nearest single effect (below).
4. :func:`refit_named`: the named effects found again, free of the discretisation error of the mesh.

A law that is learned at a port may stand alone or beside the best effect, and the two say different things. Where a
wrong effect does nearly the same as what is missing, a law of what it leaves still shows where that really acts. And
where an effect is right, but the rig follows another law than the catalogue's (the rise of a Stribeck friction falls
off as a bell or exponentially, a stop is straight or progressive), what it leaves is explained at its own port: then
the effect is named, by another law.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.executor import side_by_side
from savgs_ident.core.presentation import Progress
from savgs_ident.diagnosis.localisation import Localisation, anywhere, localise
from savgs_ident.diagnosis.problem import AbstractProblem
from savgs_ident.diagnosis.result import NONE, Hypothesis, Kind
from savgs_ident.diagnosis.score_test import prior_conflict
from savgs_ident.diagnosis.search import (
    Findings,
    forward_selection,
    hypothesis_of,
    left_over,
    pairs_with,
    singles_among,
)
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.diagnosis.verdict import (
    BrokenTolerance,
    Change,
    UnknownEvidence,
    WeighedHypothesis,
    broken_tolerance,
    decide,
    log_prior,
    most_probable,
    reweighed,
    unknown_evidence,
    weigh,
    without_immaterial_members,
)
from savgs_ident.inference.find_map import LaplaceFit, Search, find_map, refine, search_of
from savgs_ident.inference.observations import Data, Term


@dataclass(frozen=True)
class DiagnosisProblem:
    """A plant, what it is compared with, and its baseline as given and recalibrated.

    Attributes:
        plant: the plant with its catalogue and what drives it.
        data: what it is compared with.
        search: both, as a search for parameters takes them.
        given: rows of the baseline as given [unit of each reading], (m,).
        base: the baseline recalibrated.
        constants: what the verdict is decided by.
    """

    plant: AbstractProblem
    data: Data
    search: Search
    given: NDArray[np.float64]
    base: LaplaceFit
    constants: DecisionConstants = DEFAULTS

    def location(self, effect: str) -> str:
        """Where an effect of the catalogue acts."""
        return self.plant.catalogue[effect].port.location

    def locations(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """Where the effects of a hypothesis act, each location once."""
        return tuple(dict.fromkeys(self.location(name) for name in hypothesis.effects))

    def parameter_port(self, parameter: str) -> str | None:
        """The location at which a parameter of the plant acts; None for one that no port has (hardpoints)."""
        return self._parameter_ports.get(parameter)

    def terms(self, hypothesis: Hypothesis) -> tuple[Term, ...]:
        """The candidates that a hypothesis consists of."""
        return tuple(self._candidates[name] for name in hypothesis.effects)

    @cached_property
    def _parameter_ports(self) -> Mapping[str, str]:
        return {number.name: port.location for port in self.plant.model(()).ports for number in port.numbers}

    @cached_property
    def _candidates(self) -> Mapping[str, Term]:
        return {term.name: term for term in self.plant.candidates}


class LocationWeight(NamedTuple):
    """A law at a location, alone or beside effects: its log evidence plus the log prior of the effects."""

    location: str
    weight: float


@dataclass(frozen=True)
class DiagnosisEvidence:
    """What speaks for every hypothesis, and what may be said.

    Attributes:
        findings: all hypotheses that were scored and fitted.
        localisations: what a law at each location would explain.
        location_weights: laws at all locations, alone and, where that was compared, beside the best single effect.
        weighed: hypotheses by falling weight.
        unknown: what speaks most for something that the catalogue lacks.
        broken: the tolerance that most probably does not hold.
        kind: what may be said.
        chosen: the hypothesis that it rests on.
        left: share of the baseline's misfit that the most probable hypothesis leaves.
        another_law: whether the named effect acts by another law than the catalogue's.
        refit_failed: whether what is named could not be found again on a finer mesh.
        unsupported: whether what would be named predicts tests that were held out no better than the baseline.
    """

    findings: Findings
    localisations: tuple[Localisation, ...]
    location_weights: tuple[LocationWeight, ...]
    weighed: tuple[WeighedHypothesis, ...]
    unknown: UnknownEvidence
    broken: BrokenTolerance
    kind: Kind
    chosen: WeighedHypothesis
    left: float
    another_law: bool = False
    refit_failed: bool = False
    unsupported: bool = False

    @property
    def localisation(self) -> Localisation:
        """The location at which a law of something unknown is most probable."""
        first = next(iter(weight_by_location(self.location_weights)))
        return next(each for each in self.localisations if each.name == first)

    @property
    def port(self) -> str:
        """Where something unknown acts: the port of a broken tolerance, if that is it, or that of the law."""
        broken = self.broken.port if self.unknown.reason == "tolerance" else None
        return self.localisation.name if broken is None else broken

    def indistinguishable_ports(self, constants: DecisionConstants = DEFAULTS) -> tuple[str, ...]:
        """Other ports at which a law of something unknown is nearly as probable, the most probable first."""
        if self.port != self.localisation.name:
            return ()
        (_, most), *others = weight_by_location(self.location_weights).items()
        least = most - constants.indistinguishable_log_odds
        return tuple(name for name, weight in others if weight > least)


def recalibrate(
    plant: AbstractProblem,
    data: Data,
    values: Mapping[str, float],
    progress: Progress,
    constants: DecisionConstants = DEFAULTS,
) -> DiagnosisProblem:
    """The baseline at its own best: what calibration alone can do. It is started from ``values`` [SI].

    Raises :class:`InputError` for a baseline that cannot be solved.
    """
    progress("solving the baseline")
    warm_start, _ = side_by_side(lambda: plant.start(values), plant.rehearse)
    search = search_of(plant, data)
    given = plant.predict((), values, [each.name for each in plant.nuisances], warm_start)
    progress("recalibrating the baseline")
    base = find_map(search, (), values, warm_start)
    if not base.solved:
        raise InputError("the baseline cannot be recalibrated", remedy="mend the rig file")
    fine = refine(search, base, ())
    data = plant.with_background(data, fine.values, fine.prediction.warm_start)
    if data is search.data:
        return DiagnosisProblem(plant, data, search, given.rows, fine, constants)
    progress("recalibrating with a background of small errors")
    search = search_of(plant, data)
    base = replace(find_map(search, (), fine.values, fine.prediction.warm_start), precise=True)
    return DiagnosisProblem(plant, data, search, given.rows, base, constants)


def select_model(problem: DiagnosisProblem, progress: Progress) -> DiagnosisEvidence:
    """Hypotheses, ports and the kind of the verdict."""
    plant, search, base, constants = problem.plant, problem.search, problem.base, problem.constants
    progress("locating the gap, and looking for its cause")
    findings, localisations = side_by_side(
        lambda: forward_selection(search, base, plant.candidates, progress, plant.known, constants),
        lambda: _localised(problem, base),
    )
    findings = _with_nearest(problem, findings, localisations, progress)
    findings, beside = _law_beside_best(problem, _material(problem, findings), progress)
    best = most_probable(findings, constants)
    left = left_over(search, base, best, constants)
    broken = broken_tolerance(
        findings,
        lambda mode: prior_conflict(mode, plant.nuisances, constants),
        problem.parameter_port,
        constants,
    )
    first = max(localisations, key=lambda each: each.evidence)
    change = _change(problem, first.held_out - base.prediction.rows)
    alone = anywhere(localisations) if change.matters(constants) else -np.inf
    unknown = unknown_evidence(findings, alone, beside, broken.weight, constants)
    weighed = weigh(findings, unknown, constants)
    kind, chosen = decide(weighed, change_without(problem, best, best.terms), left, constants)
    found = DiagnosisEvidence(
        findings=findings,
        localisations=tuple(localisations),
        location_weights=weights_of(localisations),
        weighed=weighed,
        unknown=unknown,
        broken=broken,
        kind=kind,
        chosen=chosen,
        left=left,
    )
    if kind != "unknown" or unknown.reason == "tolerance":
        return found
    return _beside_nearest_effect(problem, found, progress)


def without_support(evidence: DiagnosisEvidence) -> DiagnosisEvidence:
    """The evidence where held-out tests do not bear out what it speaks for: then nothing may be named."""
    none = next(each for each in evidence.weighed if each.hypothesis == NONE)
    return replace(evidence, kind="none", chosen=none, another_law=False, unsupported=True)


def refit_named(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, progress: Progress
) -> tuple[DiagnosisProblem, DiagnosisEvidence]:
    """The problem and its evidence with the named effects found again, free of the mesh's discretisation error."""
    mode = evidence.chosen.mode
    if evidence.kind not in ("effect", "several") or mode is None:
        return problem, evidence
    progress(f"refitting {evidence.chosen.hypothesis}")
    plant = problem.plant.corrected(mode.terms, mode.values, mode.prediction.warm_start)
    if plant is problem.plant:
        return problem, replace(evidence, refit_failed=True)
    search = search_of(plant, problem.data)
    found = find_map(
        search, problem.terms(evidence.chosen.hypothesis), mode.values, mode.prediction.warm_start
    )
    if not found.solved:
        return problem, replace(evidence, refit_failed=True)
    chosen = replace(evidence.chosen, mode=found)
    weighed = tuple(chosen if each is evidence.chosen else each for each in evidence.weighed)
    modes = tuple(found if each is mode else each for each in evidence.findings.modes)
    return replace(problem, plant=plant, search=search), replace(
        evidence,
        findings=replace(evidence.findings, modes=modes),
        weighed=weighed,
        chosen=chosen,
    )


def _beside_nearest_effect(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, progress: Progress
) -> DiagnosisEvidence:
    """Evidence for something unknown, seen beside the single effect that does nearly the same, if there is one.

    It may act elsewhere than it seems without the effect, or be that effect by another law.
    """
    constants, base = problem.constants, problem.base
    singles = [mode for mode in evidence.findings.modes if len(mode.terms) == 1]
    best = max(singles, key=lambda mode: mode.evidence, default=base)
    if not best.terms:
        return evidence
    left = left_over(problem.search, base, best, constants)
    material = change_without(problem, best, best.terms).matters(constants)
    if left > constants.unexplained_share_other_law or not material:
        return evidence
    progress(f"what {best.terms[0]} leaves")
    prior = log_prior(hypothesis_of(best), len(evidence.findings.scores), constants)
    port = problem.location(best.terms[0])
    names = {port, *may_be_imitated(evidence.localisations, base.evidence, constants)}
    beside = [each for each in _localised(problem, best) if each.name in names]
    location_weights = (*evidence.location_weights, *weights_of(beside, prior))
    closer = replace(evidence, location_weights=location_weights)
    own, elsewhere = weights_here_and_elsewhere(location_weights, port)
    if own < elsewhere + constants.indistinguishable_log_odds:
        return closer
    unknown = log(constants.prior_unknown)
    weighed = reweighed(evidence.weighed, best, own + unknown, elsewhere + unknown)
    chosen = next(each for each in weighed if each.mode is best)
    return replace(closer, weighed=weighed, kind="effect", chosen=chosen, left=left, another_law=True)


def _with_nearest(
    problem: DiagnosisProblem, findings: Findings, localisations: Sequence[Localisation], progress: Progress
) -> Findings:
    """The findings, and where they leave much, the single effects at the locations that explain most."""
    constants = problem.constants
    left = left_over(problem.search, problem.base, most_probable(findings, constants), constants)
    if left <= constants.unexplained_share:
        return findings
    ranked = sorted(localisations, key=lambda each: -each.evidence)
    nearest = [
        each.name for each in ranked[: constants.nearest_ports] if each.evidence > problem.base.evidence
    ]
    candidates = problem.plant.candidates
    wanted = [term for term in candidates if problem.location(term.name) in nearest]
    if not wanted:
        return findings
    return singles_among(problem.search, findings, wanted, candidates, progress, constants)


def _law_beside_best(
    problem: DiagnosisProblem, findings: Findings, progress: Progress
) -> tuple[Findings, float]:
    """The findings, and the log evidence of a law beside the most probable of them, if what this leaves matters.

    Where it leaves much, the effects at the ports where such a law explains most are fitted beside its members.
    """
    search, constants, candidates = problem.search, problem.constants, problem.plant.candidates
    best = most_probable(findings, constants)
    left = left_over(search, problem.base, best, constants)
    # Two effects together imitate a third one well, but for a small rest.
    if not best.terms or left <= (constants.explained_share if len(best.terms) == 1 else 0.0):
        return findings, -np.inf
    progress(f"what {hypothesis_of(best)} leaves")
    localisations = sorted(_localised(problem, best), key=lambda each: -each.evidence)
    if left > constants.unexplained_share:
        ports = {each.name for each in localisations[: constants.nearest_ports]}
        partners = [term for term in candidates if problem.location(term.name) in ports]
        more = pairs_with(search, findings, best, partners, candidates, progress, constants)
        findings = _material(problem, more)
        if hypothesis_of(most_probable(findings, constants)) != hypothesis_of(best):
            return _law_beside_best(problem, findings, progress)
    change = _change(problem, localisations[0].held_out - best.prediction.rows)
    return findings, anywhere(localisations) if change.matters(constants) else -np.inf


def weights_of(localisations: Sequence[Localisation], prior: float = 0.0) -> tuple[LocationWeight, ...]:
    """Log weights of laws at locations, beside effects of this log prior if there are any."""
    return tuple(LocationWeight(each.name, each.evidence + prior) for each in localisations)


def may_be_imitated(
    localisations: Sequence[Localisation], without: float, constants: DecisionConstants = DEFAULTS
) -> frozenset[str]:
    """Locations at which something unknown may act that an effect elsewhere only imitates.

    A law there explains alone much of what one does anywhere; ``without`` is the log evidence of the model without
    a law. What explains little unless the effect is beside it is not what the effect stands in for.
    """
    least = constants.stand_in_share * (max(each.evidence for each in localisations) - without)
    return frozenset(each.name for each in localisations if each.evidence - without >= least)


def weight_by_location(weights: Sequence[LocationWeight]) -> Mapping[str, float]:
    """Log weight of every location, whatever stands beside a law there; the most probable first."""
    found: dict[str, float] = {}
    for each in weights:
        found[each.location] = float(np.logaddexp(found.get(each.location, -np.inf), each.weight))
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def weights_here_and_elsewhere(weights: Sequence[LocationWeight], location: str) -> tuple[float, float]:
    """Log weights of a law at a location and at any other, all locations with equal prior probability."""
    by_location = weight_by_location(weights)
    others = [weight for name, weight in by_location.items() if name != location]
    shared = float(np.log(max(len(by_location), 1)))
    elsewhere = float(np.logaddexp.reduce([-np.inf, *others]))
    return by_location.get(location, -np.inf) - shared, elsewhere - shared


def _localised(problem: DiagnosisProblem, mode: LaplaceFit) -> list[Localisation]:
    """What a law at each location would explain beyond a hypothesis."""
    locations = problem.plant.locations(mode.terms, mode.values, mode.prediction.warm_start)
    return localise(problem.search, mode, locations, problem.constants)


def _material(problem: DiagnosisProblem, findings: Findings) -> Findings:
    """The findings less those that need an effect which does too little to matter."""
    return without_immaterial_members(
        findings, lambda mode, gone: change_without(problem, mode, gone), problem.constants
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
    return _change(problem, mode.prediction.rows - without.rows)


def _change(problem: DiagnosisProblem, rows: NDArray[np.float64]) -> Change:
    """A change of the rows, in the channel where it is greatest."""
    channel, data = problem.plant.channel, problem.data

    def share(group: NDArray[np.intp]) -> float:
        squares, whole = np.bincount(group, rows**2), np.bincount(group, data.measured**2)
        return float(np.sqrt(np.max(squares[whole > 0.0] / whole[whole > 0.0])))

    return Change(share(channel), share(channel * data.tests + data.test))
