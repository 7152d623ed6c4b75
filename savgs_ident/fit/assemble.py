"""From the end of a minimisation to the record of a fit."""

from typing import NamedTuple

import numpy as np

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import EFFECTS
from savgs_ident.fit.covariance import UNTOLD, spread_of
from savgs_ident.fit.minimise import Minimum
from savgs_ident.fit.result import Estimate, Fit, Verdict
from savgs_ident.fit.task import Task
from savgs_ident.model.values import as_values
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import simulate_periodic


class Outcome(NamedTuple):
    """Where a fit ended: the response ``as_given`` before it, every start, the best, what it tells.

    ``as_given`` are complex harmonics [unit of the reading], (D, 2, orders + 1).
    """

    as_given: np.ndarray
    tried: tuple[Minimum, ...]
    best: Minimum
    verdict: Verdict
    wall_s: float


def assemble_fit(task: Task, outcome: Outcome) -> Fit:
    """The whole, frozen result."""
    problem, best = task.problem, outcome.best
    estimates, covariance = _estimates(task, best)
    rows = best.residual.size - len(problem.free.tolerated)
    p = problem.parameters(best.u)
    values = {each.name: each.value for each in estimates}
    rig = task.rig
    return Fit(
        rig=Rig(
            rig.name, task.table.with_values(values), rig.damper_velocity, rig.damper_force, rig.provenance
        ),
        effects=task.effects,
        estimates=estimates,
        covariance=covariance,
        chi2=float(best.residual[:rows] @ best.residual[:rows]),
        dof=problem.target.entries - len(problem.free.identified),
        prior_chi2=float(best.residual[rows:] @ best.residual[rows:]),
        status=best.status,
        dwell_status=best.solution.status(),
        verdict=outcome.verdict,
        measured=task.measured,
        orders=problem.orders,
        used=np.array(problem.target.used),
        predicted=np.array(harmonics(problem.model, p, best.solution, problem.orders)),
        frictionless=_frictionless(task, best),
        as_given=np.array(outcome.as_given),
        starts=tuple((each.cost, each.status) for each in outcome.tried),
        quantity=task.settings.quantity,
        wall_s=outcome.wall_s,
    )


def _estimates(task: Task, best: Minimum) -> tuple[tuple[Estimate, ...], np.ndarray]:
    problem = task.problem
    values = problem.parameters(best.u)
    slope = np.asarray(problem.slopes(best.u))
    spread = spread_of(best.jacobian)
    covariance = spread.covariance * np.outer(slope, slope)
    estimates = []
    for place, name in enumerate(problem.free.names):
        told = spread.sd[place] < 0.1 * UNTOLD
        stderr = float(np.sqrt(covariance[place, place])) if told else np.inf
        free = name in problem.free.identified
        known = task.table[name]
        estimates.append(
            Estimate(name, float(values[name]), stderr, known.unit, free, known.value, known.tolerance)
        )
    return tuple(estimates), covariance


def _frictionless(task: Task, best: Minimum) -> np.ndarray:
    """The same estimates with every effect at its null: the compiled model serves for SimQC too."""
    problem = task.problem
    nulls = {name: value for effect in task.effects for name, value in EFFECTS[effect].null.items()}
    p = dict(problem.parameters(best.u)) | as_values(nulls)
    solution = simulate_periodic(problem.model, p, task.excitation, task.settings.periodic)
    ok = np.array([status.ok for status in solution.status()])
    response = np.asarray(harmonics(problem.model, p, solution, problem.orders))
    return np.where(ok[:, None, None], response, np.nan)
