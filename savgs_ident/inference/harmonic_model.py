"""Harmonics as a posterior asks for them: of the model at a point, and exactly near one where it is known.

A periodic motion at nearby parameters starts from the linear prediction X + dX/du (u - u0), on the same time nodes,
and is solved until what is left is far below the noise. Solutions do not depend on each other, so that a chain is the
same however its proposals are grouped or interrupted.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.typing import NDArray

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.status import joint_status
from savgs_ident.core.threads import in_parallel
from savgs_ident.inference.background.locations import Linearisation
from savgs_ident.inference.background.shared_errors import background_about
from savgs_ident.inference.likelihood import Likelihood, sharing_errors
from savgs_ident.inference.near_mode import LinearisationPoint, LinearRows
from savgs_ident.inference.observations import Data
from savgs_ident.inference.problem import Problem
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.nearby import solve_near
from savgs_ident.simulate.periodic import PeriodicSolution, adapt, resolve
from savgs_ident.simulate.program_cache import compiled_quickly, first_alone, placed, run_cached
from savgs_ident.simulate.readings import harmonics_of
from savgs_ident.simulate.sensitivity import harmonics_with_sensitivities, trajectory_sensitivities

ENOUGH = 1e-4
"""Last relative Newton step at which a motion near the anchor counts as solved; what is left is far smaller, and that
is a hundredth of what the noise hides."""

CLOSELY = 1e-6
"""What is left of a motion, relative to its size, as steps by the anchor's linearisation show it, at which they end.

Where friction sticks at another instant there is up to a hundred times as much: with what :data:`ENOUGH` leaves, log
densities of the posterior of the rig are off by 0.007 (standard deviation), and by less than 0.03.
"""

LIMIT = 30
"""Most Newton steps of a group of tests, where there need to be any; two or three are the rule."""


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
    """Harmonics (W, D, C, K) of the model at W points, and whether all dwells were solved, (W,).

    Harmonics are in the unit of their reading.
    """

    harmonics: Complex[np.ndarray, "W D C K"]
    solved: np.ndarray


class ExactHarmonics(eqx.Module):
    """The model about an anchor."""

    problem: Problem
    likelihood: Likelihood
    anchor: Anchor

    def responses(self, us: Float[np.ndarray, "W n"]) -> Responses:
        """The model at several sets of free coordinates, on as many cores as there are."""
        found = in_parallel(
            lambda u: first_alone(_response, self.problem, self.anchor, placed(jnp.asarray(u))), us
        )
        harmonics = np.stack([np.asarray(each[0]) for each in found])
        step = np.array([float(each[1]) for each in found])
        return Responses(harmonics, (step <= ENOUGH) & np.isfinite(harmonics).all(axis=(1, 2, 3)))

    def rows(self, us: Float[np.ndarray, "W n"]) -> tuple[Float[np.ndarray, "W m"], np.ndarray]:
        """Their rows of the likelihood [unit of the reading], (W, m), and whether they were solved, (W,)."""
        found = self.responses(us)
        return np.asarray(_rows_of(self.likelihood, placed(jnp.asarray(found.harmonics)))), found.solved

    def predicted(self, u: Float[Array, " n"]) -> Trajectory:
        """The motions at free coordinates ``u``, to first order."""
        return self.anchor.predicted(u)


def anchor_at(problem: Problem, u: Float[Array, " n"], solution: PeriodicSolution) -> Anchor:
    """The anchor at free coordinates ``u`` (n,), where the model has ``solution``."""
    u = placed(u)
    slopes = Trajectory(*_slopes_of(problem, u, problem.parameters(u), solution))
    return Anchor(u, solution, slopes)


class SampledHarmonics(NamedTuple):
    """A problem of harmonics whose tests were ``recorded`` (D,) at these times, in any unit of time."""

    problem: Problem
    recorded: NDArray[np.float64]

    @property
    def free(self) -> FreeVector:
        """The parameters that are sampled."""
        return self.problem.free

    def linear_rows(
        self,
        likelihood: Likelihood,
        u: Float[Array, " n"],
        warm_start: PeriodicSolution,
        predicted: Trajectory | None = None,
    ) -> LinearRows:
        """Rows [unit of their reading] and slopes at ``u``, solved on the nodes of ``warm_start``."""
        problem, u = self.problem, placed(u)
        p = problem.parameters(u)
        solution = resolve(problem.model, p, warm_start, problem.iterations, predicted)
        names, orders = problem.free.names, problem.orders
        seen, by_name = harmonics_with_sensitivities(problem.model, p, solution, names, orders)
        rows, slopes = _rows_and_slopes(problem.free, likelihood, u, seen, by_name)
        return LinearRows(np.asarray(rows), np.asarray(slopes), solution, joint_status(solution.status()))

    def refined(self, u: Float[Array, " n"], warm_start: PeriodicSolution) -> PeriodicSolution:
        """The same motions on nodes that follow them."""
        problem = self.problem
        return adapt(
            problem.model, problem.parameters(u), warm_start, warm_start.mesh.layout, problem.iterations
        )

    def with_background(
        self, likelihood: Likelihood, at: LinearisationPoint, drifting: Sequence[str]
    ) -> tuple["SampledHarmonics", Likelihood, Data]:
        """The likelihood of rows that share the small errors that any model has, and the data that say which."""
        problem, u = self.problem, jnp.asarray(at.point[:-2])
        p = problem.parameters(u)
        about = Linearisation(problem.model, problem.model, likelihood, problem.orders, p, at.warm_start)
        columns = [problem.free.names.index(name) for name in drifting]
        per_unit = (at.slopes / np.asarray(problem.slopes(u)))[:, columns]
        data = background_about(
            likelihood.data, about, per_unit * [float(p[name]) for name in drifting], self.recorded
        )
        return self, sharing_errors(likelihood, data), data

    def exact(
        self, likelihood: Likelihood, u: Float[Array, " n"], warm_start: PeriodicSolution
    ) -> ExactHarmonics:
        """The model about ``u``, where it has the motions ``warm_start``."""
        return ExactHarmonics(self.problem, likelihood, anchor_at(self.problem, u, warm_start))


@compiled_quickly
def _rows_and_slopes(
    free: FreeVector, likelihood: Likelihood, u: Array, predicted: Array, by_name: Array
) -> tuple[Array, Array]:
    slopes = jax.vmap(likelihood.rows)(by_name).T * free.jacobian_diag(u)
    return likelihood.rows(predicted), slopes


@eqx.filter_jit
def _slopes_of(*args: Any) -> tuple[Array, ...]:
    return run_cached(_trajectory_slopes, *args)


def _trajectory_slopes(problem: Problem, u: Array, p: Any, solution: PeriodicSolution) -> tuple[Array, ...]:
    moved = trajectory_sensitivities(problem.model, p, solution, problem.free.names)
    scale = problem.slopes(u)[:, None, None]
    return moved.x * scale, moved.y * scale


@eqx.filter_jit
def _response(*args: Any) -> tuple[Array, ...]:
    return run_cached(_harmonics_near, *args)


def _harmonics_near(problem: Problem, anchor: Anchor, u: Array) -> tuple[Array, Array]:
    p, known = problem.parameters(u), anchor.solution
    motions, step = solve_near(problem.model, p, known, anchor.predicted(u), LIMIT, ENOUGH, CLOSELY)
    return harmonics_of(problem.model, p, motions, known, problem.orders), step


@eqx.filter_jit
def _rows_of(likelihood: Likelihood, harmonics: Array) -> Array:
    return jax.vmap(likelihood.rows)(harmonics)
