"""Model selection: the baseline recalibrated, hypotheses and ports compared, and what kind of verdict they allow.

Three stages, each of which returns a whole record:

1. :func:`recalibrate`: the baseline at its own best, a :class:`DiagnosisProblem`.
2. :func:`compare_models`: all hypotheses fitted, and what a law at each port would explain, as
   :class:`FittedHypotheses`.
3. :func:`decide_among`: the hypotheses weighed and the kind of the verdict, a :class:`DiagnosisEvidence`. It fits
   nothing, so that other constants can decide among the same fits.

No rig follows the catalogue's formulas to the letter: the rise of a Stribeck friction falls off as a bell or
exponentially, a stop is straight or progressive. Hypotheses are a tree: a port, a family of laws there, a law. Where
the laws of the catalogue leave something, the flexible member of a port takes their place (:mod:`.learning`), fitted
on the nonlinear plant: its evidence says where, its functions say of which family, and the effect that comes nearest
is named beside it.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import hypot, log, sqrt

import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Progress
from savgs_ident.core.threads import side_by_side
from savgs_ident.diagnosis.evidence import (
    DiagnosisEvidence,
    DiagnosisProblem,
    FittedHypotheses,
    FlexibleMember,
    is_better_form,
)
from savgs_ident.diagnosis.findings import (
    Findings,
    hypothesis_of,
    left_over,
    to_be_gained,
)
from savgs_ident.diagnosis.laws_to_learn import laws_instead_of_two, learned_laws, rehearse
from savgs_ident.diagnosis.learning import LearnedLaw
from savgs_ident.diagnosis.localisation import Localisation, anywhere, localise
from savgs_ident.diagnosis.materiality import (
    change_by_law,
    change_by_tolerances,
    change_of,
    change_without,
    immaterial,
    material,
)
from savgs_ident.diagnosis.problem import AbstractProblem
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Hypothesis
from savgs_ident.diagnosis.search import pairs_with, single_effects, singles_among, with_pairs
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.diagnosis.verdict import (
    WeighedHypothesis,
    decide,
    log_prior_of_pair,
    most_probable,
    unknown_evidence,
    weigh,
)
from savgs_ident.effects.base import PortKind
from savgs_ident.inference.find_map import find_map, find_map_again, refine
from savgs_ident.inference.laplace_fit import LaplaceFit, Start, search_of
from savgs_ident.inference.observations import Data


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
    found, _ = side_by_side(lambda: _recalibrated(plant, data, values, progress, constants), plant.rehearse)
    return found


def _recalibrated(
    plant: AbstractProblem,
    data: Data,
    values: Mapping[str, float],
    progress: Progress,
    constants: DecisionConstants,
) -> DiagnosisProblem:
    progress("solving the baseline")
    warm_start = plant.start(values)
    search = search_of(plant, data)
    given = plant.predict((), values, [each.name for each in plant.nuisances], warm_start)
    progress("recalibrating the baseline")
    base = find_map(search, (), values, warm_start)
    if not base.solved:
        raise InputError("the baseline cannot be recalibrated", remedy="mend the rig file")
    fine = refine(search, base, ())
    data = plant.with_background(data, fine.values, fine.prediction.warm_start)
    start = Start(
        {each.name: values.get(each.name, each.value(0.0)) for each in plant.nuisances}, given.warm_start
    )
    if data is search.data:
        return DiagnosisProblem(plant, data, replace(search, given=start), given.rows, fine, constants)
    progress("recalibrating with a background of small errors")
    search = search_of(plant, data, start)
    base = replace(find_map_again(search, (), fine), precise=True)
    return DiagnosisProblem(plant, data, search, given.rows, base, constants)


def compare_models(problem: DiagnosisProblem, progress: Progress) -> FittedHypotheses:
    """All hypotheses fitted, and what a law at each port would explain.

    Single effects first; where none explains all, the flexible members of the ports, and pairs of effects; where
    these do not either, laws beside the best of all.
    """
    plant, search, base, constants = problem.plant, problem.search, problem.base, problem.constants
    progress("locating the gap, and looking for its cause")
    with ThreadPoolExecutor(1) as pool:
        located = pool.submit(_localised, problem, base)
        findings = single_effects(
            search,
            base,
            plant.candidates,
            progress,
            plant.known,
            constants,
            lambda: rehearse(problem, located.result()),
        )
        localisations = located.result()
    laws = learned_laws(problem, findings, localisations, progress)
    members = _flexible_members(problem, laws, len(localisations))
    findings = _with_formulas_of(problem, findings, members, progress)
    beside, least = -np.inf, -np.inf
    law_explains = _law_explains(members, localisations, constants)
    if law_explains:
        least = members[0].weight - log_prior_of_pair(len(findings.scores), constants)
    findings = with_pairs(search, findings, plant.candidates, progress, constants, least)
    if not law_explains:
        findings = _with_nearest(problem, findings, localisations, progress)
        findings, beside = _law_beside_best(problem, material(problem, findings), progress)
    best = most_probable(findings, constants)
    laws = laws or laws_instead_of_two(problem, findings, best, progress)
    return FittedHypotheses(
        findings, tuple(localisations), laws, beside, best, change_without(problem, best, best.terms)
    )


def _with_formulas_of(
    problem: DiagnosisProblem, findings: Findings, members: Sequence[FlexibleMember], progress: Progress
) -> Findings:
    """The findings, and the catalogue's formulas of the families of those learned laws that leave little.

    The law is known where one of them does as much, at its own location or beside it. Of a law in series, all
    formulas at its port: without what gives way calibration turns the forces behind it into others, beside which it
    would do hardly anything, and what is learned there may be of another family.
    """
    if not members:
        return findings
    most, candidates = problem.constants.unexplained_share_flexible, problem.plant.candidates
    little = [each for each in members if each is members[0] or each.left <= most]
    families = {each.hypothesis.flexible for each in little}
    series = {each.law.port.name for each in little if each.law.port.kind is PortKind.SERIES}
    wanted = [
        each
        for each in candidates
        if not families.isdisjoint(problem.families(Hypothesis((each.name,))))
        or problem.plant.catalogue[each.name].port.name in series
    ]
    return singles_among(problem.search, findings, wanted, candidates, progress, problem.constants)


def _law_explains(
    members: Sequence[FlexibleMember], localisations: Sequence[Localisation], constants: DecisionConstants
) -> bool:
    """Whether a learned law leaves next to nothing, and no location where none was learned promises more."""
    if not members or members[0].left > constants.explained_share_flexible:
        return False
    others = _not_learned(members, localisations)
    return not others or members[0].weight >= anywhere(others) + log(constants.prior_unknown)


def _not_learned(
    members: Sequence[FlexibleMember], localisations: Sequence[Localisation]
) -> list[Localisation]:
    """The locations that no learned law stands for."""
    learned = {each.location for each in members}
    return [each for each in localisations if each.name not in learned]


def decide_among(problem: DiagnosisProblem, fitted: FittedHypotheses) -> DiagnosisEvidence:
    """What the weights of all hypotheses allow to say, by the constants of the problem."""
    search, base, constants = problem.search, problem.base, problem.constants
    findings, localisations = fitted.findings, fitted.localisations
    members = _flexible_members(problem, fitted.laws, len(localisations))
    best, count = most_probable(findings, constants), len(findings.scores)
    broken, beside = problem.broken_beside(base, count), problem.broken_beside(best, count)
    change = fitted.change if best is fitted.best else change_without(problem, best, best.terms)
    left = left_over(search, base, best, constants)
    # A law that was learned on the nonlinear plant stands for itself.
    others = _not_learned(members, localisations)
    alone = -np.inf
    if others:
        first = max(others, key=lambda each: each.evidence)
        alone = anywhere(others) if change_of(problem, first.moved).matters(constants) else -np.inf
    # A number that is off where the catalogue has its change is that effect.
    is_effect = problem.is_tolerance(hypothesis_of(best), broken)
    also = [] if not best.terms else [beside.weight, broken.weight] if is_effect else [beside.weight]
    is_unknown = not is_effect and change_by_tolerances(problem, broken.conflict.off).matters(constants)
    unknown = unknown_evidence(findings, alone, fitted.beside, broken if is_unknown else None, constants)
    weighed = weigh(findings, unknown, constants, {hypothesis_of(best): also})
    kind, chosen = decide(weighed, change, left, constants, unknown.reason)
    more = [WeighedHypothesis(each.hypothesis, each.weight, each.law.mode, each.sd) for each in members]
    weighed = tuple(sorted((*weighed, *more), key=lambda each: -each.weight))
    too_little = dict(immaterial(problem, findings, members))
    if unknown.reason == "tolerance":
        # The recalibrated baseline has the number that is off already.
        too_little[UNKNOWN] = 1.0
    found = DiagnosisEvidence(
        findings=findings,
        localisations=localisations,
        flexible=tuple(members),
        weighed=weighed,
        unknown=unknown,
        broken=broken,
        kind=kind,
        chosen=chosen,
        left=left,
        immaterial=too_little,
        insufficient=_insufficient(problem, findings, members),
        off=beside.conflict.off if best.terms and beside.is_likely(constants) else {},
    )
    if not members or not (
        _is_named(problem, found, members[0]) or is_better_form(problem, found, members[0])
    ):
        return found
    chosen = next(each for each in weighed if each.mode is members[0].law.mode)
    return replace(found, kind="effect", chosen=chosen, named_law=members[0])


def _insufficient(
    problem: DiagnosisProblem, findings: Findings, members: Sequence[FlexibleMember]
) -> tuple[Hypothesis, ...]:
    """Fitted hypotheses that leave more of the misfit than what is named may leave."""
    constants = problem.constants
    lefts = [(mode, left_over(problem.search, problem.base, mode, constants)) for mode in findings.modes]
    effects = [hypothesis_of(mode) for mode, left in lefts if left > constants.unexplained_share]
    laws = [each.hypothesis for each in members if each.left > constants.unexplained_share_flexible]
    return (*effects, *laws)


def _is_named(problem: DiagnosisProblem, evidence: DiagnosisEvidence, member: FlexibleMember) -> bool:
    """Whether a learned law is what is missing: more probable than the catalogue's, near to all, and of some size."""
    constants = problem.constants
    none = next(each for each in evidence.weighed if each.hypothesis == NONE)
    fitted = [each.weight for each in evidence.weighed if each.mode is not None and each.hypothesis.effects]
    if member.weight < max([none.weight + constants.alarm_log_odds, evidence.unknown.weight, *fitted]):
        return False
    explains = member.left <= constants.unexplained_share_flexible
    return explains and change_by_law(problem, member.law).matters(constants)


def _flexible_members(
    problem: DiagnosisProblem, laws: Sequence[LearnedLaw], locations: int
) -> list[FlexibleMember]:
    """Learned laws as hypotheses among laws at so many ``locations``, the most probable first."""
    constants = problem.constants
    prior = log(constants.prior_unknown / max(locations, 1))
    listed = {(each.port.location, each.law.family) for each in problem.plant.catalogue.values()}

    def member(law: LearnedLaw) -> FlexibleMember:
        known = (law.port.location, law.family) in listed
        relative = law.log_prior + (0.0 if known else log(constants.unlisted_family_prior))
        basis = constants.rest_uncertainty * to_be_gained(law.search, law.mode)
        return FlexibleMember(
            law,
            law.mode.evidence + prior + relative,
            left_over(law.search, problem.base, law.mode, constants),
            hypot(constants.coefficient_uncertainty * sqrt(law.identified), basis),
            relative,
        )

    return sorted(map(member, laws), key=lambda each: -each.weight)


def _with_nearest(
    problem: DiagnosisProblem, findings: Findings, localisations: Sequence[Localisation], progress: Progress
) -> Findings:
    """The findings, and where they leave much, the single effects at the locations that explain most.

    And what swings, wherever it is: about the recalibrated baseline a sharp resonance may show at none of them.
    """
    constants = problem.constants
    left = left_over(problem.search, problem.base, most_probable(findings, constants), constants)
    if left <= constants.unexplained_share:
        return findings
    ranked = sorted(localisations, key=lambda each: -each.evidence)
    nearest = [
        each.name for each in ranked[: constants.nearest_ports] if each.evidence > problem.base.evidence
    ]
    candidates = problem.plant.candidates
    wanted = [term for term in candidates if term.tries or problem.location(term.name) in nearest]
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
        others = [term for term in candidates if problem.location(term.name) in ports]
        more = pairs_with(search, findings, best, others, candidates, progress, constants)
        findings = material(problem, more)
        if hypothesis_of(most_probable(findings, constants)) != hypothesis_of(best):
            return _law_beside_best(problem, findings, progress)
    change = change_of(problem, localisations[0].moved)
    return findings, anywhere(localisations) if change.matters(constants) else -np.inf


def _localised(problem: DiagnosisProblem, mode: LaplaceFit) -> list[Localisation]:
    """What a law at each location would explain beyond a hypothesis."""
    locations = problem.plant.locations(mode.terms, mode.values, mode.prediction.warm_start)
    return localise(problem.search, mode, locations, problem.constants)
