"""What a fit identifies: errors, what trades off, how low a parameter can go, which further test would help.

Identified parameters without a tolerance live on logarithmic coordinates, so a direction that the data do not
identify is a product of powers: (+1, +1) on (mu_t, ydot_Hth) means that both may grow together while their ratio
stays. The verdict names such groups and says what is known instead. How low a parameter of such a group can go is
its profile likelihood's to say: it is held while all others follow. Which dwell would help follows from the
sensitivities of candidates, faster and slower dwells and other amplitudes with the noise of the dwells at hand,
added to the information of the fit.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress, percent
from savgs_ident.fit.estimate import at_bounds, with_unit
from savgs_ident.fit.identified import Verdict
from savgs_ident.fit.minimise import Minimiser, Minimum
from savgs_ident.fit.result import comparable, gaps
from savgs_ident.inference.laplace import spread_of
from savgs_ident.inference.problem import Pins, Problem, Task
from savgs_ident.inference.targets import HarmonicTarget
from savgs_ident.plants.base import Excitation
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic
from savgs_ident.simulate.readings import harmonics

LARGEST_SD = 0.25
"""A free parameter is identifiable if its standard error is below this share of its value."""

MEMBER = 0.3
"""A parameter belongs to a direction that is not identifiable if its share of the unit direction is above this."""


def confounded_groups(names: tuple[str, ...], covariance: NDArray[np.float64]) -> tuple[tuple[str, ...], ...]:
    """Groups of free parameters that trade off, from the covariance of their logarithms (n, n)."""
    variance, axes = np.linalg.eigh(covariance)
    groups: list[set[str]] = []
    for spread, axis in zip(np.sqrt(np.maximum(variance, 0.0)), axes.T, strict=True):
        if spread > LARGEST_SD:
            members = {name for name, share in zip(names, axis, strict=True) if abs(share) > MEMBER}
            touching = [group for group in groups if group & members]
            groups = [g for g in groups if g not in touching] + [members.union(*touching)]
    return tuple(tuple(name for name in names if name in group) for group in groups)


def known_combination(
    pair: tuple[str, str], names: tuple[str, ...], covariance: NDArray[np.float64]
) -> tuple[str, float]:
    """The better known of ratio and product of two parameters, and its relative standard error [1].

    ``covariance`` (n, n) is that of the logarithms.
    """
    i, j = (names.index(name) for name in pair)
    own = covariance[i, i] + covariance[j, j]
    ratio, product = (np.sqrt(max(own + sign * 2.0 * covariance[i, j], 0.0)) for sign in (-1.0, 1.0))
    return (f"{pair[0]}/{pair[1]}", ratio) if ratio <= product else (f"{pair[0]} x {pair[1]}", product)


def verdict_of(
    names: tuple[str, ...],
    values: Mapping[str, float],
    units: Mapping[str, str],
    covariance: NDArray[np.float64],
    bounds: Mapping[str, float],
    advice: tuple[str, ...],
    ended: Mapping[str, str],
) -> Verdict:
    """The verdict for free parameters ``names`` whose logarithms have ``covariance`` (n, n).

    ``bounds`` holds 95 % lower bounds of unidentifiable parameters [SI], ``advice`` which tests would help, ``ended``
    what is said of parameters that ended at a bound: whatever their errors are there, they are not identified.
    """
    sd = np.sqrt(np.diag(covariance))
    groups = confounded_groups(names, covariance)
    in_group = {name for group in groups for name in group}
    held = in_group | set(ended)
    identifiable = [n for n in names if n not in held and sd[names.index(n)] <= LARGEST_SD]
    sentences = []
    if identifiable:
        figures = ", ".join(f"{name} to {100.0 * sd[names.index(name)]:.2g} %" for name in identifiable)
        sentences.append(f"These data identify {figures}.")
    for group in groups:
        sentences += _about_group(group, names, values, units, covariance)
    unknown = [n for n in names if n not in identifiable and n not in held]
    sentences += [f"These data do not identify {name}." for name in unknown]
    sentences += [
        f"{name} is at least {with_unit(bound, units[name])} (95 %, profile likelihood)."
        for name, bound in bounds.items()
    ]
    everything = not groups and not unknown and not ended
    return Verdict(everything, (*sentences, *ended.values(), *advice), groups)


def _about_group(
    group: tuple[str, ...],
    names: tuple[str, ...],
    values: Mapping[str, float],
    units: Mapping[str, str],
    covariance: NDArray[np.float64],
) -> list[str]:
    if len(group) == 1:
        return [f"These data do not identify {group[0]}."]
    sentences = [f"{' and '.join(group)} cannot be distinguished: they trade off along a line."]
    if len(group) == 2:
        pair = (group[0], group[1])
        label, error = known_combination(pair, names, covariance)
        if error <= LARGEST_SD:
            first, second = values[pair[0]], values[pair[1]]
            value = first / second if "/" in label else first * second
            unit = f"{units[pair[0]]}/({units[pair[1]]})" if "/" in label else "(SI)"
            sentences.append(f"What is known is {label} = {value:.4g} {unit}, to {100.0 * error:.2g} %.")
    return sentences


PIN = 1e4
"""Weight that holds a coordinate: it gives way by chi2-sensitivity / PIN^2."""

STEPS = 6

CHI2_95 = 3.841458820694124
"""95 % point of chi2 with one degree of freedom."""


def held_at(
    minimiser: Minimiser, start: Minimum, name: str, coordinate: float, progress: Progress
) -> Minimum:
    """Refit everything with one parameter's unconstrained coordinate [1] held."""
    place = minimiser.problem.free.names.index(name)
    blank = jnp.zeros_like(start.u)
    pins = Pins(blank.at[place].set(PIN), blank.at[place].set(coordinate))
    moved = start.u.at[place].set(coordinate)
    return minimiser.minimise(moved, start.solution, STEPS, progress, pins)


def lower_bound(minimiser: Minimiser, best: Minimum, name: str, progress: Progress) -> float | None:
    """The smallest value of a parameter within the 95 % region of its profile; None if there is none.

    Halves outward from the best fit until chi2 has risen by :data:`CHI2_95`, then bisects to 3 %.
    """
    problem, place = minimiser.problem, minimiser.problem.free.names.index(name)

    def rise(at: Minimum, coordinate: float) -> tuple[Minimum, float]:
        found = held_at(minimiser, at, name, coordinate, progress)
        return found, found.cost - best.cost

    inside, at = float(best.u[place]), best
    for _ in range(8):
        trial, gain = rise(at, inside - np.log(1.5))
        if not trial.evaluation.ok or gain > CHI2_95:
            break
        inside, at = inside - np.log(1.5), trial
    else:
        return None
    outside = inside - np.log(1.5)
    while inside - outside > 0.03:
        middle = 0.5 * (inside + outside)
        trial, gain = rise(at, middle)
        if trial.evaluation.ok and gain <= CHI2_95:
            inside, at = middle, trial
        else:
            outside = middle
    return float(problem.parameters(at.u)[name])


class Candidate(NamedTuple):
    """A family of dwells: what it is in words, and what drives the plant in each."""

    label: str
    excitation: Excitation


class Proposal(NamedTuple):
    """A dwell that would help: in words, and the worst standard error of the free logarithms with it [1]."""

    test: str
    worst_sd: float


def candidates(excitation: Excitation, driven: str) -> tuple[Candidate, ...]:
    """Families with as many dwells as were recorded: faster, slower, smaller and larger motions of one input."""
    frequency = np.asarray(excitation.frequency)
    count = frequency.size
    faster = np.linspace(frequency.max(), 2.0 * frequency.max(), count + 1)[1:]
    slower = np.linspace(0.4 * frequency.min(), frequency.min(), count + 1)[:-1]
    families = [
        Candidate("a faster dwell", _sine_in(driven, excitation, faster, 1.0)),
        Candidate("a slower dwell", _sine_in(driven, excitation, slower, 1.0)),
        Candidate("a dwell at 0.7 of the amplitude", _sine_in(driven, excitation, frequency, 0.7)),
        Candidate("a dwell at 1.4 of the amplitude", _sine_in(driven, excitation, frequency, 1.4)),
    ]
    return tuple(families)


def _sine_in(driven: str, excitation: Excitation, frequency: NDArray[np.float64], scale: float) -> Excitation:
    """The recorded amplitudes of one input at other frequencies and sizes, with the others at rest."""

    def moved(name: str, recorded: Array) -> Array:
        still = jnp.zeros_like(recorded)
        if name == driven:
            return still.at[:, 1].set(scale * jnp.abs(recorded[:, 1]))
        return still.at[:, 0].set(recorded[:, 0])

    inputs = {name: moved(name, recorded) for name, recorded in excitation.harmonics.items()}
    return Excitation(jnp.asarray(frequency), inputs)


def propose_dwells(minimiser: Minimiser, best: Minimum, settings: PeriodicSettings) -> tuple[Proposal, ...]:
    """The best dwell of every family that would identify all free parameters; empty if none would."""
    excitation = best.solution.excitation
    free = len(minimiser.problem.free.identified)

    def worst(jacobian: NDArray[np.float64]) -> float:
        return float(spread_of(jacobian).sd[:free].max())

    leaders = []
    for candidate in candidates(excitation, minimiser.problem.model.inputs[0].name):
        proposals = _proposals(minimiser, best, candidate, settings, worst)
        leader = min(proposals, key=lambda each: each.worst_sd, default=None)
        if leader is not None and leader.worst_sd <= LARGEST_SD:
            leaders.append(leader)
    return tuple(leaders)


def _proposals(
    minimiser: Minimiser,
    best: Minimum,
    candidate: Candidate,
    settings: PeriodicSettings,
    worst: Callable[[NDArray[np.float64]], float],
) -> list[Proposal]:
    problem = minimiser.problem
    p = problem.parameters(best.u)
    layout = best.solution.mesh.layout
    solution = simulate_periodic(problem.model, p, candidate.excitation, settings, layout)
    found = minimiser.evaluate(best.u, solution)
    dwells = candidate.excitation.frequency.size
    priors = len(problem.free.names)
    rows = found.jacobian[: found.jacobian.shape[0] - priors].reshape(dwells, -1, found.jacobian.shape[1])
    proposals = []
    for dwell, status in enumerate(solution.status()):
        if status.ok and np.isfinite(rows[dwell]).all():
            sd = worst(np.concatenate([best.jacobian, rows[dwell]]))
            hertz = float(candidate.excitation.frequency[dwell])
            proposals.append(Proposal(f"{candidate.label}, {hertz:.2g} Hz", sd))
    return proposals


INFORMED = 0.5
"""Share of its spread before the data below which an identified parameter has a standard error."""

EXPLAINED = 2.0
"""chi2 per datum up to which the data count as explained."""

MATERIAL_MISFIT = 0.005
"""Share of the response, beyond the noise, by which a model may miss and still be the right one [1].

It decides where no background of small errors could be fitted. Origin: by choice. Small errors that every model has
add up to so much: 0.2 % at each of the ports of a plant, a damper's table that is 2 % off point by point.
"""


def explained_by_noise(problem: Problem, best: Minimum) -> bool:
    """Whether the model at ``best`` misses the data by about their noise."""
    return _chi2_per_datum(problem, best) <= EXPLAINED


def misses_little(task: Task, best: Minimum) -> bool:
    """Whether the model at ``best`` misses the data by no more than small errors that every model has."""
    return _misfit(task, best) <= MATERIAL_MISFIT


def assess(task: Task, minimiser: Minimiser, best: Minimum, explained: bool, progress: Progress) -> Verdict:
    """What the data say of the free parameters at ``best``, whose Jacobian is that of all that is known there."""
    if not best.finite:
        return Verdict(False, (BROKEN_DOWN,), explained=False)
    values = {name: float(value) for name, value in task.problem.parameters(best.u).items()}
    ended = at_bounds((task.table[name] for name in task.problem.free.identified), values)
    return _verdict(task, minimiser, best, values, ended, explained, progress)


def _verdict(
    task: Task,
    minimiser: Minimiser,
    best: Minimum,
    values: Mapping[str, float],
    ended: Mapping[str, str],
    explained: bool,
    progress: Progress,
) -> Verdict:
    problem, table = task.problem, task.table
    names = problem.free.identified
    units = {name: table[name].unit for name in names}
    per_datum, missed = _chi2_per_datum(problem, best), _misfit(task, best)
    if not explained:
        return Verdict(False, (unexplained(per_datum, missed), *ended.values()), explained=False)
    covariance = _log_covariance(problem, best, values)
    bounds: dict[str, float] = {}
    advice: tuple[str, ...] = ()
    if np.sqrt(np.diag(covariance)).max() > LARGEST_SD:
        for group in confounded_groups(names, covariance):
            name = group[-1]  # The others follow it along the line that they trade off along.
            progress(f"looking for a lower bound of {name}")
            bound = lower_bound(minimiser, best, name, progress)
            bounds |= {} if bound is None else {name: bound}
        progress("looking for a test that would help")
        advice = advice_of(task, minimiser, best)
    verdict = verdict_of(names, values, units, covariance, bounds, advice, ended)
    if per_datum <= EXPLAINED:
        return verdict
    beyond = (
        f"The model misses by {percent(missed)} of the response beyond the noise (chi2/dof = {per_datum:.4g}), "
        "no more than small errors of any model; the errors of the parameters contain it."
    )
    return replace(verdict, sentences=(beyond, *verdict.sentences))


BROKEN_DOWN = (
    "The fit broke down: nothing can be said about the parameters. Where a model lacks something they go far to make "
    "up for it: look for what is missing with `diagnose`."
)
"""What is said of a fit whose residuals or slopes are no numbers at its end."""


def unexplained(per_datum: float, missed: float) -> str:
    """That a model misses its data, by chi2 per datum and as a share of the response [1]."""
    return (
        f"The model does not explain these data: it misses by {percent(missed)} of the response beyond the "
        f"noise (chi2/dof = {per_datum:.4g}). Where units and signs are sure, look with `diagnose` for what is "
        "missing, or follows another law. Until then the parameters make up for it, and may be off by more than "
        "their errors."
    )


def _rows_of(problem: Problem, best: Minimum) -> np.ndarray:
    """The residuals of the data [noise sd], without those of the priors."""
    return best.residual[: best.residual.size - len(problem.free.names)]


def _chi2_per_datum(problem: Problem, best: Minimum) -> float:
    rows = _rows_of(problem, best)
    return float(rows @ rows) / max(problem.target.entries - len(problem.free.identified), 1)


def _misfit(task: Task, best: Minimum) -> float:
    """By how much the model misses beyond the noise, as a share of the response [1], channels pooled."""
    problem, measured = task.problem, task.measured
    predicted = np.array(harmonics(problem.model, problem.parameters(best.u), best.solution, problem.orders))
    if isinstance(problem.target, HarmonicTarget):
        predicted = problem.target.with_nuisances(predicted)
    names = [each.name for each in problem.model.channels]
    used = comparable(measured, names, problem.orders)
    gap = gaps(measured, names, predicted, used)["together"]
    return float(np.sqrt(max(gap.relative**2 - gap.floor**2, 0.0)))


CHANCE = 3.0
"""Standard deviations of chi2 by which it may be above its expectation by chance."""


def weighed_by_misfit(problem: Problem, best: Minimum) -> np.ndarray:
    """The Jacobian of data and priors (m, n) [1], the data weighed by what they leave unexplained.

    What is not explained shows only where no parameter can make up for it. As much may lie where a parameter does
    make up for it, all of it along that parameter: the errors are as large as that. Where the data are explained to
    within the chance of the noise, the Jacobian is that of the noise alone.
    """
    rows = _rows_of(problem, best)
    expected = problem.target.entries - len(problem.free.identified)
    weighed = np.array(best.jacobian)
    weighed[: rows.size] /= widened_by_misfit(float(rows @ rows), expected)
    return weighed


def widened_by_misfit(chi2: float, expected: int) -> float:
    """By what factor errors grow [1] where ``chi2`` is beyond the ``expected`` one, and what chance adds to it."""
    beyond = chi2 - expected - CHANCE * np.sqrt(2.0 * max(expected, 0))
    return float(np.sqrt(1.0 + max(beyond, 0.0)))


def advice_of(task: Task, minimiser: Minimiser, best: Minimum) -> tuple[str, ...]:
    """In words, which further dwells would identify every free parameter; nothing beside tests that do not repeat."""
    if task.excitation.windows.size:
        # Tests that do not repeat have no amplitude and no frequency to go by.
        return ()
    proposals = propose_dwells(minimiser, best, task.settings.periodic)
    if not proposals:
        return ("No single further dwell that was considered would help.",)
    tests = "; ".join(f"{each.test} (to {100.0 * each.worst_sd:.2g} %)" for each in proposals)
    return (f"What would identify every free parameter: {tests}.",)


def _log_covariance(problem: Problem, best: Minimum, values: Mapping[str, float]) -> np.ndarray:
    """Covariance of the logarithms of the free parameters."""
    count = len(problem.free.identified)
    slope = np.asarray(problem.slopes(best.u))[:count]
    scale = slope / np.array([values[name] for name in problem.free.identified])
    return spread_of(best.jacobian).covariance[:count, :count] * np.outer(scale, scale)
