"""Which laws are learned, and when: those at the ports where they promise to explain what is missing."""

from collections.abc import Sequence

from savgs_ident.core.presentation import Progress
from savgs_ident.diagnosis.evidence import DiagnosisProblem
from savgs_ident.diagnosis.findings import Findings, explains_all, hypothesis_of, left_over
from savgs_ident.diagnosis.learning import LearnedLaw, learn, rehearse_learning
from savgs_ident.diagnosis.localisation import Localisation, anywhere
from savgs_ident.diagnosis.result import UNKNOWN
from savgs_ident.diagnosis.verdict import log_prior, most_probable
from savgs_ident.effects.base import Port, PortKind
from savgs_ident.inference.laplace_fit import LaplaceFit


def rehearse(problem: DiagnosisProblem, localisations: Sequence[Localisation]) -> None:
    """Have compiled what a law at the most promising port asks for, while single effects are fitted."""
    for name in _promising_ports(problem, localisations)[:1]:
        rehearse_learning(problem.plant, problem.base, problem.port(name))


def learned_laws(
    problem: DiagnosisProblem,
    findings: Findings,
    localisations: Sequence[Localisation],
    progress: Progress,
) -> tuple[LearnedLaw, ...]:
    """Learned laws on the nonlinear plant at the ports that explain most.

    None where a single effect explains all, and a law to first order is certainly less probable, or where nothing
    seems to be missing.
    """
    constants, base = problem.constants, problem.base
    best, linear = most_probable(findings, constants), anywhere(localisations)
    if max(best.evidence, linear) < base.evidence + constants.alarm_log_odds:
        return ()
    count = len(findings.scores)
    weight = best.evidence + log_prior(hypothesis_of(best), count, constants)
    explained = explains_all(problem.search, base, best, constants)
    law = linear + log_prior(UNKNOWN, count, constants)
    # To first order a law that calibration nearly takes up is less probable than it is.
    if explained and weight >= law + constants.indistinguishable_log_odds:
        return ()
    ports = _worth_learning(problem, findings, localisations)
    least, given = best.evidence - constants.refined_log_evidence, problem.search.given
    return learn(problem.plant, problem.data, base, ports, constants, given, progress, least)


def laws_instead_of_two(
    problem: DiagnosisProblem, findings: Findings, best: LaplaceFit, progress: Progress
) -> tuple[LearnedLaw, ...]:
    """Learned laws where effects act that explain all alone, if two effects are more probable still.

    The second may stand for what a formula has wrong: of the first, or of what does nearly the same elsewhere.
    """
    if len(best.terms) < 2:
        return ()
    constants, search = problem.constants, problem.search
    alone = [
        mode
        for mode in findings.modes
        if len(mode.terms) == 1
        and left_over(search, problem.base, mode, constants) <= constants.explained_share
    ]
    ports = dict.fromkeys(problem.plant.catalogue[mode.terms[0]].port.name for mode in alone)
    nearest = list(ports)[: constants.nearest_ports]
    wanted = [problem.port(name) for name in dict.fromkeys([*nearest, *_in_series(problem, nearest)])]
    least = best.evidence - constants.refined_log_evidence
    return learn(problem.plant, problem.data, problem.base, wanted, constants, search.given, progress, least)


def _worth_learning(
    problem: DiagnosisProblem, findings: Findings, localisations: Sequence[Localisation]
) -> list[Port]:
    """The ports whose learned laws are worth a fit: those that explain most to first order, if that is anything.

    And the ports of the best single effects, and what is in series with the nearest ports: to first order about the
    baseline a strong effect may explain little, and a play with a film in it hardly anything.
    """
    constants = problem.constants
    ranked = _promising_ports(problem, localisations)
    ranked += _in_series(problem, ranked[: constants.nearest_ports])
    singles = [mode for mode in findings.modes if len(mode.terms) == 1]
    ranked += [
        problem.plant.catalogue[mode.terms[0]].port.name for mode in singles[: constants.nearest_ports]
    ]
    return [problem.port(name) for name in dict.fromkeys(ranked)]


def _promising_ports(problem: DiagnosisProblem, localisations: Sequence[Localisation]) -> list[str]:
    """The ports that explain most to first order, if that is anything."""
    constants = problem.constants
    least = problem.base.evidence + constants.alarm_log_odds
    ports = {
        name: weight
        for each in localisations
        for name, weight in each.ports.items()
        if name and weight > least
    }
    return sorted(ports, key=lambda name: -ports[name])[: constants.learned_fits]


def _in_series(problem: DiagnosisProblem, names: Sequence[str]) -> list[str]:
    """The series ports at the locations of some ports."""
    locations = {problem.port(name).location for name in names}
    return [
        each.name
        for each in problem.plant.plant.ports
        if each.kind is PortKind.SERIES and each.location in locations
    ]
