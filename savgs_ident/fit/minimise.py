"""Levenberg-Marquardt steps of optimistix, taken one by one: the least-squares fit.

Taking the steps from Python costs nothing beside the model and lets each one be reported and interrupted. The problem
is evaluated, residuals and Jacobian, before the optimiser is asked for its step.

This is not the search of :func:`savgs_ident.inference.find_map.find_map`, which was tried in its place, with the same
priors, rows whose noise is known and no discrepancy. Measured, with an evaluation being one solution of the model:

- Where the model explains the data both do the same. Shipped campaign: 6 evaluations each, estimates within 1e-4 of
  their standard errors, chi2 to 5e-8. Its peak-to-peak values: 17 evaluations in place of 31, within 0.03.
- Where it does not, the sum of squares is rough with friction, and the two end apart. Recordings with Stribeck
  friction at the rail: 71 evaluations in place of 73, chi2 off by 1e-3, estimates by up to 0.9 standard errors, for
  a sum of squares lower by 4e-4 (this one had reached its step limit). With a compliant mount: 72 in place of 70,
  2.5e-4, 0.15, lower by 3e-4.
- There it takes 24 s in place of 16 s, and 23 s in place of 17 s: a step that is rejected costs it a Jacobian, for a
  prediction has its slopes. With a lag of the accelerometer both reach their step limit, that one after 173
  evaluations and 71 s, this one after 90 and 39 s: a step that it halves counts as one.

The pins hold one coordinate for a profile by a weight, so that one compiled program serves all coordinates.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from savgs_ident.core.presentation import Progress
from savgs_ident.core.status import Status
from savgs_ident.inference.problem import Evaluation, Linearised, Pins, Problem, evaluate, evaluate_beside
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import compiled_quickly, placed

TOLERANCE = 1e-2
"""Change of coordinates and of what the optimiser is given at which it stops by itself."""

SHARPNESS = 30.0
"""Residuals are given to the optimiser in this part of a standard deviation. It damps the first step by one of
its units of information on every coordinate: a whole standard deviation would hold back the tolerances, of
which data and prior together hardly hold more."""


IN_VAIN = 16
"""Steps in a row that lead no lower, after which no further one is tried: each is a quarter of the one before it."""

NOTHING = 1e-10
"""A change of chi2 that means nothing, however small chi2 is."""


class Minimum(NamedTuple):
    """Where a minimisation ended.

    ``residual`` (m,) and ``jacobian`` (m, n) of data and priors are those at ``u`` (n,); ``solution`` is
    the model's there. All of these have no dimension [1]: coordinates are scaled, residuals whitened.
    ``status`` says how the minimisation ended, ``evaluation`` how the motions and the numbers at its end were found,
    ``finite`` whether residuals and Jacobian are numbers, as they may be where a motion was not found.
    """

    u: Float[Array, " n"]
    residual: np.ndarray
    jacobian: np.ndarray
    solution: PeriodicSolution
    status: Status
    evaluation: Status
    finite: bool

    @property
    def cost(self) -> float:
        """Sum of squared residuals [1], priors included."""
        return float(self.residual @ self.residual)


def _affine(u: Array, at: Linearised) -> tuple[Array, None]:
    """Value and derivative are the problem's own where the optimiser asks for them: at the point evaluated."""
    return SHARPNESS * (at.residual + at.jacobian @ (u - at.u)), None


@compiled_quickly
def _step(solver: Any, u: Array, at: Linearised, state: Any) -> tuple[Any, ...]:
    u, state, _ = solver.step(_affine, u, at, {}, state, frozenset())
    done, result = solver.terminate(_affine, u, at, {}, state, frozenset())
    return u, state, done, result == optx.RESULTS.successful


@eqx.filter_jit
def _blank(solver: Any, rows: int, count: int) -> Any:
    u, residual = jnp.zeros(count), jnp.zeros(rows)
    nowhere = Linearised(u, residual, jnp.zeros((rows, count)))
    return solver.init(_affine, u, nowhere, {}, jax.eval_shape(lambda: residual), None, frozenset())


def _left_to_gain(at: Linearised) -> float:
    """By how much a Gauss-Newton step would lower the sum of squares."""
    residual, matrix = np.asarray(at.residual), np.asarray(at.jacobian)
    along = matrix @ np.linalg.lstsq(matrix, residual)[0]
    return float(along @ along)


class Minimiser(eqx.Module):
    """A problem with its compiled step.

    The optimiser's initial state carries a traced program, which is why one state is made and kept: a new one
    would be a new program to compile.
    """

    problem: Problem
    solver: Any
    blank: Any

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.solver = optx.LevenbergMarquardt(rtol=TOLERANCE, atol=TOLERANCE)
        count = len(problem.free.names)
        self.blank = _blank(self.solver, problem.target.size + 2 * count, count)

    def minimise(
        self,
        u: Float[Array, " n"],
        warm_start: PeriodicSolution,
        steps: int,
        progress: Progress,
        pins: Pins | None = None,
        enough: float = 1e-6,
    ) -> Minimum:
        """Minimise from ``u``, on the nodes of the solution ``warm_start`` there, parameters pinned as given.

        The last step is the one after which the linearisation promises to lower the sum of squares by less
        than the share ``enough``, or that the optimiser takes for its last and that lowered it by no more, or the
        last of :data:`IN_VAIN` that did not lower it at all. It may
        lead past points where a motion was not found, but not end at one: the status is that of the motion.
        """
        pins = pins or self.problem.unpinned
        best = trial = evaluate(self.problem, u, pins, warm_start)
        u, state = trial.at.u, eqx.tree_at(lambda each: each.y_eval, placed(self.blank), trial.at.u)
        status, before, in_vain = Status.MAX_ITERATIONS, np.inf, 0
        for count in range(1, steps + 1):
            u, state, done, fine = _step(self.solver, u, trial.at, state)
            taken = np.array_equal(u, trial.at.u)
            best, in_vain = (trial, 0) if taken else (best, in_vain + 1)
            cost = float(np.sum(np.asarray(best.at.residual) ** 2))
            if not (fine and best.finite):
                status = Status.NOT_FINITE if best.status.ok else best.status
                break
            progress(f"step {count}: chi2 = {cost:.6g}")
            small = enough * cost + NOTHING
            if _left_to_gain(best.at) < small or (done and before - cost < small):
                status = best.status
                break
            before = cost
            if in_vain == IN_VAIN:
                status = Status.STALLED
                break
            if count < steps:
                trial = evaluate_beside(self.problem, state.y_eval, pins, best)
        return _minimum(best, status)

    def evaluate(self, u: Float[Array, " n"], warm_start: PeriodicSolution) -> Minimum:
        """Residuals and Jacobian at free coordinates ``u`` [1], without moving."""
        found = evaluate(self.problem, u, self.problem.unpinned, warm_start)
        return _minimum(found, found.status)


def _minimum(found: Evaluation, status: Status) -> Minimum:
    u, residual, jacobian = found.at
    rows = residual.size - u.size
    return Minimum(
        u,
        np.asarray(residual)[:rows],
        np.asarray(jacobian)[:rows],
        found.solution,
        status,
        found.status,
        found.finite,
    )
