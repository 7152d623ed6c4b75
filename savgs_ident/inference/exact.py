"""The exact model near a known solution: what decides about every proposal.

A periodic motion at nearby parameters starts from the linear prediction X + dX/du (u - u0), on the same time
nodes, and is solved until what is left is far below the noise. Solutions do not depend on each other, so that
a chain is the same however its proposals are grouped or interrupted.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.inference.problem import Problem
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.periodic import PeriodicSolution, harmonics, harmonics_of, resolve, solve_near
from savgs_ident.simulate.program_cache import placed, stored
from savgs_ident.simulate.sensitivity import harmonic_sensitivities, trajectory_sensitivities

ENOUGH = 1e-4
"""Last relative Newton step at which a motion near the anchor counts as solved; what is left is far smaller, and that
is a hundredth of what the noise hides."""

LIMIT = 30
"""Most Newton steps; two or three are the rule."""


class Anchor(eqx.Module):
    """Free coordinates u (n,) where the model is known: its motions and their derivatives in u, (n, ...) each."""

    u: Float[Array, " n"]
    solution: PeriodicSolution
    slopes: Trajectory

    def predicted(self, u: Float[Array, " n"]) -> Trajectory:
        """The motions at free coordinates ``u``, to first order."""
        parts = zip(self.solution.trajectory, self.slopes, strict=True)
        return Trajectory(*(value + jnp.tensordot(u - self.u, slope, 1) for value, slope in parts))


class Responses(NamedTuple):
    """Harmonics (W, D, 2, K) of the model at W points, and whether all dwells were solved, (W,).

    Harmonics are in the unit of their reading.
    """

    harmonics: Complex[np.ndarray, "W D C K"]
    solved: np.ndarray


class ExactModel(eqx.Module):
    """The model about an anchor."""

    problem: Problem
    likelihood: Likelihood
    anchor: Anchor

    def responses(self, us: Float[np.ndarray, "W n"]) -> Responses:
        """The model at several sets of free coordinates, on as many cores as there are."""
        found = in_parallel(lambda u: _response(self.problem, self.anchor, placed(jnp.asarray(u))), us)
        harmonics = np.stack([np.asarray(each[0]) for each in found])
        step = np.array([float(each[1]) for each in found])
        return Responses(harmonics, (step <= ENOUGH) & np.isfinite(harmonics).all(axis=(1, 2, 3)))

    def rows(self, us: Float[np.ndarray, "W n"]) -> tuple[Float[np.ndarray, "W m"], np.ndarray]:
        """Their rows of the likelihood [unit of the reading], (W, m), and whether they were solved, (W,)."""
        found = self.responses(us)
        return np.asarray(_rows_of(self.likelihood, placed(jnp.asarray(found.harmonics)))), found.solved


def in_parallel(work: Any, items: Sequence[Any] | np.ndarray) -> list[Any]:
    """``work`` on every item, numbers of any unit and arrays of any shape, in their order.

    A solver leaves Python free while it runs.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        return list(pool.map(work, items))


def anchor_at(problem: Problem, u: Float[Array, " n"], solution: PeriodicSolution) -> Anchor:
    """The anchor at free coordinates ``u`` (n,), where the model has ``solution``."""
    u = placed(u)
    slopes = Trajectory(*_slopes_of(problem, u, problem.parameters(u), solution))
    return Anchor(u, solution, slopes)


def rows_and_slopes(
    problem: Problem,
    likelihood: Likelihood,
    u: Float[Array, " n"],
    warm_start: PeriodicSolution,
    start: Trajectory | None = None,
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m n"], PeriodicSolution]:
    """The rows (m,) of the model at ``u``, their derivatives in u (m, n), and its motions there.

    Solved on the nodes of ``warm_start``, from its motions or a better ``start``. ``u`` are free coordinates,
    rows are in the unit of their reading.
    """
    u = placed(u)
    p = problem.parameters(u)
    solution = resolve(problem.model, p, warm_start, problem.iterations, start)
    rows, slopes = _linear_rows(problem, likelihood, u, p, solution)
    return np.asarray(rows), np.asarray(slopes), solution


@eqx.filter_jit
def _linear_rows(*args: Any) -> tuple[Array, ...]:
    return stored(_rows_and_derivatives, *args)


def _rows_and_derivatives(
    problem: Problem, likelihood: Likelihood, u: Array, p: Any, solution: PeriodicSolution
) -> tuple[Array, Array]:
    by_name = harmonic_sensitivities(problem.model, p, solution, problem.free.names, problem.orders)
    slopes = jax.vmap(likelihood.rows)(by_name).T * problem.slopes(u)
    return likelihood.rows(harmonics(problem.model, p, solution, problem.orders)), slopes


@eqx.filter_jit
def _slopes_of(*args: Any) -> tuple[Array, ...]:
    return stored(_trajectory_slopes, *args)


def _trajectory_slopes(problem: Problem, u: Array, p: Any, solution: PeriodicSolution) -> tuple[Array, ...]:
    moved = trajectory_sensitivities(problem.model, p, solution, problem.free.names)
    scale = problem.slopes(u)[:, None, None]
    return moved.x * scale, moved.y * scale


@eqx.filter_jit
def _response(*args: Any) -> tuple[Array, ...]:
    return stored(_harmonics_near, *args)


def _harmonics_near(problem: Problem, anchor: Anchor, u: Array) -> tuple[Array, Array]:
    p, known = problem.parameters(u), anchor.solution
    motions, step = solve_near(problem.model, p, known, anchor.predicted(u), LIMIT, ENOUGH)
    return harmonics_of(problem.model, p, motions, known, problem.orders), step


@eqx.filter_jit
def _rows_of(likelihood: Likelihood, harmonics: Array) -> Array:
    return jax.vmap(likelihood.rows)(harmonics)
