"""The fit: from a measured response to identified parameters with their covariance.

    fit = fit_least_squares(measured, model, free=("mu_r", "mu_t", "ydot_Hth", "c_sd"))
    fit.by_name["mu_r"].value, fit.by_name["mu_r"].stderr

The free parameters are asked for; those known to a tolerance are estimated along. All have the transform and the
prior of :mod:`savgs_ident.core.transforms`, of which only a tolerance is felt. Each start is solved cold and
minimised on its own time nodes; the best is minimised once more on nodes adapted to it. From there the fit goes on
with the small errors that every model has (:mod:`savgs_ident.fit.small_errors`).
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.presentation import NO_ORIGIN, Origin, Progress
from savgs_ident.core.status import Status
from savgs_ident.core.threads import beside
from savgs_ident.core.values import as_values
from savgs_ident.fit.estimate import Estimate
from savgs_ident.fit.identifiability import (
    EXPLAINED,
    INFORMED,
    assess,
    explained_by_noise,
    misses_little,
    weighed_by_misfit,
)
from savgs_ident.fit.identified import Verdict
from savgs_ident.fit.minimise import Minimiser, Minimum
from savgs_ident.fit.result import Fit
from savgs_ident.fit.small_errors import FitWithErrors, fit_with_errors, own_part
from savgs_ident.inference.background import imposed
from savgs_ident.inference.laplace import spread_of
from savgs_ident.inference.likelihood import likelihood_of
from savgs_ident.inference.problem import Problem, ProblemSettings, Quantity, Task, plan_task
from savgs_ident.inference.targets import HarmonicTarget, Target
from savgs_ident.plants.at_rest import require_return
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    adapt,
    blank_solution,
    layout_of,
    simulate_periodic,
    solve_on_mesh,
)
from savgs_ident.simulate.program_cache import placed
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import rehearse_sensitivities


@dataclass(frozen=True)
class FitSettings:
    """How to fit.

    Attributes:
        orders: highest harmonic order that is compared.
        fixed_tolerances: take the parameters with a tolerance as exact instead of estimating them along.
        quantity: compare complex harmonics, or peak-to-peak values only, as the paper did.
        starts: most starting points of the optimisation; the model's values are the first, and further ones
            are tried if that does not explain the data.
        steps: most steps from one start.
        periodic: how finely to solve the model.
    """

    orders: int = 9
    fixed_tolerances: bool = False
    quantity: Quantity = "harmonics"
    starts: int = 3
    steps: int = 40
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)

    @property
    def problem(self) -> ProblemSettings:
        """What is compared with what."""
        return ProblemSettings(self.orders, self.fixed_tolerances, self.quantity, self.periodic)


class Outcome(NamedTuple):
    """Where a fit ended: the response ``as_given`` before it, every start, the best, what it identifies.

    ``as_given`` are complex harmonics [unit of the reading], (D, C, orders + 1); ``covariance`` (n, n) is that of the
    unconstrained coordinates [1], ``own`` the part of it that another campaign of the rig does not share.
    """

    as_given: np.ndarray
    tried: tuple[Minimum, ...]
    best: Minimum
    covariance: np.ndarray
    own: np.ndarray
    verdict: Verdict
    wall_s: float


def assemble_fit(task: Task, outcome: Outcome, origin: Origin) -> Fit:
    """The whole, frozen result."""
    problem, best = task.problem, outcome.best
    estimates, covariance = _estimates(task, outcome)
    rows = best.residual.size - len(problem.free.names)
    p = problem.parameters(best.u)
    values = {each.name: each.value for each in estimates}
    frictionless, frictionless_status = _frictionless(task, best)
    return Fit(
        estimated=task.model.with_values(values),
        estimates=estimates,
        covariance=covariance,
        chi2=float(best.residual[:rows] @ best.residual[:rows]),
        dof=problem.target.entries - len(problem.free.identified),
        prior_chi2=float(best.residual[rows:] @ best.residual[rows:]),
        status=best.status,
        dwell_status=best.solution.status(),
        verdict=outcome.verdict,
        measured=task.measured,
        orders=min(problem.orders, task.settings.orders) if task.measured.dwells.size else problem.orders,
        used=np.array(problem.target.used),
        predicted=_read(problem.target, harmonics(problem.model, p, best.solution, problem.orders)),
        frictionless=_read(problem.target, frictionless),
        frictionless_status=frictionless_status,
        as_given=_read(problem.target, outcome.as_given),
        starts=tuple((each.cost, each.status) for each in outcome.tried),
        quantity=task.settings.quantity,
        wall_s=outcome.wall_s,
        origin=origin,
    )


def _read(target: Target, predicted: Any) -> NDArray[np.complex128]:
    """Predicted harmonics (D, C, K) [unit of each] as sensors with offsets read them, where these do not count."""
    found = np.array(predicted)
    return target.with_nuisances(found) if isinstance(target, HarmonicTarget) else found


def _estimates(task: Task, outcome: Outcome) -> tuple[tuple[Estimate, ...], np.ndarray]:
    problem, best = task.problem, outcome.best
    values = problem.parameters(best.u)
    slope = np.asarray(problem.slopes(best.u))
    # The part that is the campaign's own is a difference, which rounding may take below zero.
    sd, own = (np.sqrt(np.maximum(np.diag(each), 0.0)) for each in (outcome.covariance, outcome.own))
    widths, estimates = problem.free.widths, []
    for place, name in enumerate(problem.free.names):
        known = sd[place] < INFORMED * widths[place] or name in problem.free.tolerated
        before = task.table[name]
        # Of a typical number at an end of its range nothing is known but that it would go further.
        known &= not before.is_typical or abs(slope[place]) > AT_AN_END * abs(float(values[name]))
        unit = abs(slope[place]) if known else np.inf
        estimates.append(
            Estimate(
                name=name,
                value=float(values[name]),
                stderr=float(unit * sd[place]),
                own_stderr=float(unit * own[place]),
                unit=before.unit,
                free=name in problem.free.identified,
                prior=before.value,
                prior_sd=0.0 if before.is_typical else before.tolerance,
            )
        )
    return tuple(estimates), outcome.covariance * np.outer(slope, slope)


AT_AN_END = 0.01
"""Relative change of a typical number per unit of its coordinate [1] below which it is at an end of its range."""


def _prior_sd(problem: Problem) -> np.ndarray:
    """Standard deviations of the coordinates (n,) before the data [1]; infinite of what is identified."""
    known = np.isin(problem.free.names, problem.free.tolerated)
    return np.where(known, np.asarray(problem.free.widths), np.inf)


def _frictionless(task: Task, best: Minimum) -> tuple[np.ndarray, tuple[Status, ...]]:
    """The same estimates with every effect at its null: the compiled model serves for the plant alone too."""
    problem = task.problem
    nulls = {name: value for effect in problem.model.effects for name, value in effect.null.items()}
    p = dict(problem.parameters(best.u)) | as_values(nulls)
    solution = simulate_periodic(problem.model, p, task.excitation, task.settings.periodic)
    statuses = solution.status()
    ok = np.array([status.ok for status in statuses])
    response = np.asarray(harmonics(problem.model, p, solution, problem.orders))
    return np.where(ok[:, None, None], response, np.nan), statuses


ROUGHLY = 0.05
"""Share of chi2 below which a step is not worth another before the nodes are adapted to the result."""

EXPLORING = 12
"""Most steps from a further start: enough to see whether it leads to a better minimum."""

_SHIFT = 0.4
"""Distance of further starts from the first in every identified coordinate: about a factor of one and a half, or less
than half a tolerance."""


def fit_least_squares(
    measured: HarmonicResponse,
    model: Model,
    *,
    free: tuple[str, ...],
    settings: FitSettings | None = None,
    origin: Origin = NO_ORIGIN,
    motion: PeriodicSolution | None = None,
    values: Mapping[str, float] = MappingProxyType({}),
    begin: Float[Array, " n"] | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit ``free`` parameters of a model to a measured response.

    ``origin`` is that of the result; ``motion`` is that of the model as given in the same tests, where it is known
    already; the search begins with the ``values`` [SI] that are given, or goes on from the free coordinates ``begin``
    where these were found before, and no other start is tried; ``progress`` is called with what is being done. Raises
    :class:`InputError` for names that do not exist or that the model does not use, for a response that cannot be
    used, and for a plant that may be anywhere, as no force brings it back. Look at ``trusted`` of the result.
    """
    began, report = time.perf_counter(), progress or _silent
    settings = settings or FitSettings()
    task = plan_task(measured, model, free, settings.problem)
    problem = task.problem

    minimiser = Minimiser(problem)
    with beside(partial(_rehearse, task)):
        report("solving the model as given")
        first = _as_given(task, motion)
        if not any(each.ok for each in first.status()):
            require_return(problem.model, problem.fixed)
        as_given = np.asarray(harmonics(problem.model, problem.fixed, first, problem.orders))
        report("preparing the fit")
        starts = _starts(task, settings.starts, values) if begin is None else [begin]
        if begin is not None or values:
            p = problem.parameters(starts[0])
            first = simulate_periodic(problem.model, p, task.excitation, settings.periodic)
        tried = _tried(task, minimiser, starts, first, settings.steps, report)
        report("refining on nodes adapted to the result")
        best = _best_refined(task, minimiser, tried, settings.steps, report)
    with_errors = fit_with_errors(task, minimiser, best, report)
    if isinstance(with_errors, FitWithErrors):
        best, information, own = with_errors.best, with_errors.information, with_errors.own
        covariance, explained = with_errors.covariance, True
    else:
        information = weighed_by_misfit(problem, best)
        covariance = spread_of(information).covariance
        own = own_part(covariance, _prior_sd(problem))
        explained = explained_by_noise(problem, best) or (with_errors is None and misses_little(task, best))
    verdict = assess(task, minimiser, best._replace(jacobian=information), explained, report)
    wall_s = time.perf_counter() - began
    return assemble_fit(task, Outcome(as_given, tuple(tried), best, covariance, own, verdict, wall_s), origin)


def _rehearse(task: Task) -> None:
    """Have compiled, or read from the cache, what comes after the model is solved."""
    problem, target = task.problem, task.problem.target
    layout = layout_of(task.excitation, task.settings.periodic, problem.model)
    blank = blank_solution(problem.model, task.excitation, layout)
    p, orders = placed(dict(problem.fixed)), problem.orders
    rehearse_sensitivities(problem.model, p, blank, problem.free.names, orders)
    if isinstance(target, HarmonicTarget):
        imposed.rehearse(problem.model, likelihood_of(target), orders, p, blank)


def _tried(
    task: Task,
    minimiser: Minimiser,
    starts: Sequence[Array],
    first: PeriodicSolution,
    steps: int,
    report: Progress,
) -> list[Minimum]:
    """Minima from the starts, until one explains the data; the motions at the first start are ``first``."""
    tried = [minimiser.minimise(starts[0], first, steps, report, enough=ROUGHLY)]
    for u in starts[1:]:
        if tried[0].status.ok and tried[0].cost < EXPLAINED * task.problem.target.entries:
            break
        report("trying another start")
        tried.append(_from_start(task, minimiser, u, min(EXPLORING, steps), report))
    return tried


def _as_given(task: Task, motion: PeriodicSolution | None) -> PeriodicSolution:
    """The motion of the model before the fit, from one that is known where that leads to it."""
    problem, periodic = task.problem, task.settings.periodic
    if motion is not None:
        mesh, start = motion.mesh, motion.trajectory
        near = solve_on_mesh(problem.model, problem.fixed, task.excitation, mesh, start, periodic.iterations)
        if all(each.ok for each in near.status()):
            return near
    return simulate_periodic(problem.model, problem.fixed, task.excitation, periodic)


def _silent(line: str) -> None:
    del line


def _starts(task: Task, most: int, values: Mapping[str, float]) -> list[Array]:
    """The values given [SI], or the model's, then points to alternating sides of them in the free coordinates."""
    free = task.problem.free
    first = free.to_unconstrained(dict(task.table.as_dict()) | dict(values))
    count, starts = len(free.identified), [first]
    for number in range(1, most):
        signs = [1.0 if (number >> (place % 4)) & 1 else -1.0 for place in range(count)]
        shifted = np.array(first)
        shifted[:count] += _SHIFT * np.array(signs)
        starts.append(jnp.asarray(shifted))
    return starts


def _from_start(task: Task, minimiser: Minimiser, u: Array, steps: int, report: Progress) -> Minimum:
    p = task.problem.parameters(u)
    warm_start = simulate_periodic(task.problem.model, p, task.excitation, task.settings.periodic)
    return minimiser.minimise(u, warm_start, steps, report, enough=ROUGHLY)


def _best_refined(
    task: Task, minimiser: Minimiser, tried: list[Minimum], steps: int, report: Progress
) -> Minimum:
    """The lowest of several minima, refined, at which all motions are found; the lowest where they are at none."""
    ranked = sorted(tried, key=lambda each: np.nan_to_num(each.cost, nan=np.inf))
    refined = list[Minimum]()
    for each in ranked:
        # A motion that was lost on the way may be found on other nodes: a low minimum is not given up for it.
        refined.append(_refined(task, minimiser, each, steps, report))
        if refined[-1].evaluation.ok:
            return refined[-1]
    return refined[0]


def _refined(task: Task, minimiser: Minimiser, best: Minimum, steps: int, report: Progress) -> Minimum:
    # Motions that were not found on the first nodes may be found on those adapted to them.
    if not np.isfinite(best.cost):
        return best
    p, layout = task.problem.parameters(best.u), best.solution.mesh.layout
    limit = task.settings.periodic.iterations
    warm_start = adapt(task.problem.model, p, best.solution, layout, limit)
    return minimiser.minimise(best.u, warm_start, steps, report)
