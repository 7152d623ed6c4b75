"""The fit: from a measured response to identified parameters with their covariance.

    fit = fit_least_squares(measured, rig, effects=MODELS["simtr"], free=FREE)
    fit.by_name["mu_r"].value, fit.by_name["mu_r"].stderr

The free parameters are told by the data alone; parameters known to a tolerance are estimated along under
their priors. Each start is solved cold and minimised on its own time nodes; the best is minimised once more
on nodes adapted to it.
"""

import time

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from savgs_ident.core.rig import Rig
from savgs_ident.fit.assemble import Outcome, assemble_fit
from savgs_ident.fit.judge import EXPLAINED, judge
from savgs_ident.fit.minimise import Minimiser, Minimum, Progress
from savgs_ident.fit.result import Fit
from savgs_ident.fit.settings import FitSettings
from savgs_ident.fit.task import Task, plan_task
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import adapt, simulate_periodic

FREE = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
"""The four parameters that the paper identifies."""

ROUGHLY = 0.05
"""Share of chi2 below which a step is not worth another before the nodes are adapted to the result."""

EXPLORING = 12
"""Most steps from a further start: enough to see whether it leads to a better minimum."""

_SHIFT = 0.4
"""Distance of further starts from the first in every free coordinate: about a factor of one and a half."""


def fit_least_squares(
    measured: HarmonicResponse,
    rig: Rig,
    *,
    effects: tuple[str, ...],
    free: tuple[str, ...],
    settings: FitSettings | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit ``free`` parameters of a rig with ``effects`` to a measured response.

    ``progress`` is told what is going on. Raises :class:`InputError` for names that do not exist or that the
    model does not use, and for a response that cannot be used. Look at ``trusted`` of the result.
    """
    began, tell = time.perf_counter(), progress or _silent
    task = plan_task(measured, rig, effects, free, settings or FitSettings())
    problem = task.problem

    tell("solving the model as given")
    first = simulate_periodic(problem.model, problem.fixed, task.excitation, task.settings.periodic)
    as_given = np.asarray(harmonics(problem.model, problem.fixed, first, problem.orders))
    tell("preparing the fit")
    minimiser = Minimiser(problem)
    first_u, *others = _starts(task)
    tried = [minimiser.minimise(first_u, first, task.settings.steps, tell, enough=ROUGHLY)]
    for u in others:
        if tried[0].status.ok and tried[0].cost < EXPLAINED * problem.target.entries:
            break
        tell("trying another start")
        tried.append(_from_start(task, minimiser, u, tell))
    best = min(tried, key=lambda each: each.cost if np.isfinite(each.cost) else np.inf)
    tell("refining on nodes adapted to the result")
    best = _refined(task, minimiser, best, tell)
    verdict = judge(task, minimiser, best, tell)
    return assemble_fit(task, Outcome(as_given, tuple(tried), best, verdict, time.perf_counter() - began))


def _silent(line: str) -> None:
    del line


def _starts(task: Task) -> list[Array]:
    """The rig's values, then points to alternating sides of them in the free coordinates."""
    free = task.problem.free
    first = free.to_unconstrained(task.table.as_dict())
    count, starts = len(free.identified), [first]
    for number in range(1, task.settings.starts):
        signs = [1.0 if (number >> (place % 4)) & 1 else -1.0 for place in range(count)]
        starts.append(first.at[:count].add(_SHIFT * jnp.asarray(signs)))
    return starts


def _from_start(task: Task, minimiser: Minimiser, u: Array, tell: Progress) -> Minimum:
    p = task.problem.parameters(u)
    near = simulate_periodic(task.problem.model, p, task.excitation, task.settings.periodic)
    return minimiser.minimise(u, near, min(EXPLORING, task.settings.steps), tell, enough=ROUGHLY)


def _refined(task: Task, minimiser: Minimiser, best: Minimum, tell: Progress) -> Minimum:
    if not np.isfinite(best.cost):
        return best
    p, layout = task.problem.parameters(best.u), best.solution.mesh.layout
    limit = task.settings.periodic.iterations
    near = adapt(task.problem.model, p, best.solution, layout, limit)
    return minimiser.minimise(best.u, near, task.settings.steps, tell)
