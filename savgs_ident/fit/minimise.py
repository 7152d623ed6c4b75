"""Levenberg-Marquardt steps of optimistix, taken one by one.

Taking the steps from Python costs nothing beside the model and lets each one be reported and interrupted. One
compiled step serves every start, every profile and every planned test of a problem.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from savgs_ident.core.status import Status
from savgs_ident.fit.problem import Found, Pins, Problem, residuals
from savgs_ident.simulate.periodic import PeriodicSolution

Progress = Callable[[str], None]
"""Is told what is going on, a line at a time."""

TOLERANCE = 1e-2
"""Change of coordinates and residuals at which to stop; both count in standard deviations or logarithms."""


class Minimum(NamedTuple):
    """Where a minimisation ended.

    ``residual`` (m,) and ``jacobian`` (m, n) of data and priors are those at ``u`` (n,); ``solution`` is the
    model's there.
    """

    u: Float[Array, " n"]
    residual: np.ndarray
    jacobian: np.ndarray
    solution: PeriodicSolution
    status: Status

    @property
    def cost(self) -> float:
        """Sum of squared residuals, priors included."""
        return float(self.residual @ self.residual)


def _function(u: Array, args: tuple[Problem, Pins, PeriodicSolution]) -> tuple[Array, Found]:
    problem, pins, near = args
    return residuals(u, problem=problem, pins=pins, near=near)


@eqx.filter_jit
def _step(solver: Any, u: Array, args: tuple[Problem, Pins, PeriodicSolution], state: Any) -> tuple[Any, ...]:
    u, state, _ = solver.step(_function, u, args, {}, state, frozenset())
    done, result = solver.terminate(_function, u, args, {}, state, frozenset())
    return u, state, done, result == optx.RESULTS.successful


@eqx.filter_jit
def _initial(solver: Any, u: Array, args: tuple[Problem, Pins, PeriodicSolution]) -> Any:
    near = args[2]
    found = Found(near.trajectory, near.last_step)
    rows = args[0].target.size + len(args[0].free.tolerated) + u.size
    shapes = jax.ShapeDtypeStruct((rows,), u.dtype), jax.eval_shape(lambda: found)
    return solver.init(_function, u, args, {}, *shapes, frozenset())


@eqx.filter_jit
def _matrix(state: Any) -> Array:
    return state.f_info.jac.as_matrix()


def _left_to_gain(state: Any) -> float:
    """By how much a Gauss-Newton step from the last accepted point would lower the sum of squares."""
    residual, matrix = np.asarray(state.f_info.residual), np.asarray(_matrix(state))
    if not np.isfinite(matrix).all():
        return np.inf
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

    def __init__(self, problem: Problem, near: PeriodicSolution) -> None:
        self.problem = problem
        self.solver = optx.LevenbergMarquardt(rtol=TOLERANCE, atol=TOLERANCE)
        start = jnp.zeros(len(problem.free.names))
        self.blank = _initial(self.solver, start, (problem, problem.unpinned, near))

    def minimise(
        self,
        u: Float[Array, " n"],
        near: PeriodicSolution,
        steps: int,
        progress: Progress,
        pins: Pins | None = None,
        enough: float = 1e-6,
    ) -> Minimum:
        """Minimise from ``u``, on the nodes of the solution ``near`` there, parameters pinned as told.

        A step that lowers the sum of squares by less than the share ``enough`` is the last. One that was
        rejected lowers it by nothing; then what a whole step would gain by the linearisation decides.
        """
        pins = pins or self.problem.unpinned
        state = eqx.tree_at(lambda each: each.y_eval, self.blank, u)
        status, before = Status.MAX_ITERATIONS, np.inf
        for count in range(1, steps + 1):
            u, state, done, fine = _step(self.solver, u, (self.problem, pins, near), state)
            near = state.aux.put_into(near)
            cost = float(jnp.sum(state.f_info.residual**2))
            if not (fine and np.isfinite(cost)):
                status = Status.NOT_FINITE
                break
            progress(f"step {count}: chi2 = {cost:.6g}")
            gain = before - cost or _left_to_gain(state)
            if done or 0.0 <= gain < enough * cost:
                status = Status.CONVERGED
                break
            before = cost
        return self._minimum(u, near, state, status)

    def evaluate(self, u: Float[Array, " n"], near: PeriodicSolution) -> Minimum:
        """Residuals and Jacobian at ``u``, without moving."""
        state = eqx.tree_at(lambda each: each.y_eval, self.blank, u)
        args = (self.problem, self.problem.unpinned, near)
        _, state, _, fine = _step(self.solver, u, args, state)
        status = Status.CONVERGED if fine else Status.NOT_FINITE
        return self._minimum(u, state.aux.put_into(near), state, status)

    def _minimum(self, u: Array, near: PeriodicSolution, state: Any, status: Status) -> Minimum:
        rows = state.f_info.residual.size - u.size
        residual, jacobian = np.asarray(state.f_info.residual)[:rows], np.asarray(_matrix(state))[:rows]
        return Minimum(u, residual, jacobian, near, status)
