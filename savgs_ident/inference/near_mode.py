"""The model near its posterior's mode: exactly, and as a cheap stand-in to second order.

The exact model decides about every proposal of a sampler. A periodic motion at nearby parameters starts from the
linear prediction X + dX/du (u - u0), on the same time nodes, and is solved until what is left is far below the noise.
Solutions do not depend on each other, so that a chain is the same however its proposals are grouped or interrupted.

The surrogate proposes. With v one standard deviation along the principal axes, u = centre + scale v, the rows of the
likelihood are

    rows(v) = rows + slope v + 1/2 sum_ij v_i v_j bend_ij.

The slopes are exact, the second derivatives their differences one standard deviation away; of these only the
leading shapes of a singular value decomposition are kept.

Where data identify a product of two parameters far better than either of them, the posterior is a thin banana,
along which neither random steps nor trajectories get on. A triangular map straightens it:

    v_k = t_k - sum over i, j > k of share_ijk t_i t_j,

axes sorted from the best identified to the least. It makes up for most of the bend B(v, v) / 2 by a change of the
well identified coordinates, so that the rows are nearly linear in t and the posterior is nearly a unit normal. As
v_k depends on t_k and later ones only, volumes stay as they are and the way back is one substitution after the
other.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from savgs_ident.core.executor import in_parallel
from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.inference.prior import NUISANCE, Prior
from savgs_ident.inference.problem import Problem
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.periodic import PeriodicSolution, resolve, solve_near
from savgs_ident.simulate.program_cache import placed, run_cached
from savgs_ident.simulate.readings import harmonics, harmonics_of
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
    """Harmonics (W, D, C, K) of the model at W points, and whether all dwells were solved, (W,).

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
    return run_cached(_rows_and_derivatives, *args)


def _rows_and_derivatives(
    problem: Problem, likelihood: Likelihood, u: Array, p: Any, solution: PeriodicSolution
) -> tuple[Array, Array]:
    by_name = harmonic_sensitivities(problem.model, p, solution, problem.free.names, problem.orders)
    slopes = jax.vmap(likelihood.rows)(by_name).T * problem.slopes(u)
    return likelihood.rows(harmonics(problem.model, p, solution, problem.orders)), slopes


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
    motions, step = solve_near(problem.model, p, known, anchor.predicted(u), LIMIT, ENOUGH)
    return harmonics_of(problem.model, p, motions, known, problem.orders), step


@eqx.filter_jit
def _rows_of(likelihood: Likelihood, harmonics: Array) -> Array:
    return jax.vmap(likelihood.rows)(harmonics)


class TriangularMap(eqx.Module):
    """The map from t (n,) to v (n,): products t_first t_second (q,) times ``share`` (q, n)."""

    first: np.ndarray
    second: np.ndarray
    share: Float[Array, "q n"]

    def __call__(self, t: Float[Array, " n"]) -> Float[Array, " n"]:
        """The v of round coordinates t, both in standard deviations."""
        return t - (t[self.first] * t[self.second]) @ self.share

    def inverse(self, v: Float[np.ndarray, "w n"]) -> Float[np.ndarray, "w n"]:
        """The round coordinates of several v, both in standard deviations."""
        t, share = np.array(v), np.asarray(self.share)
        for axis in reversed(range(t.shape[1])):
            t[:, axis] = v[:, axis] + (t[:, self.first] * t[:, self.second]) @ share[:, axis]
        return t


def identity_map(size: int) -> TriangularMap:
    """The map that leaves v = t."""
    nothing = np.zeros(0, dtype=int)
    return TriangularMap(nothing, nothing, jnp.zeros((0, size)))


def triangular_map_of(
    second: Float[np.ndarray, "n n m"], slope: Float[np.ndarray, "m n"], weight: Float[np.ndarray, " m"]
) -> TriangularMap:
    """The map that makes up for ``second`` derivatives in v of rows with ``slope`` in v.

    ``weight`` (m,) is one over the rows' deviations; columns of slope and prior together are orthonormal. v
    is in standard deviations.
    """
    count = second.shape[0]
    first, other = np.triu_indices(count)
    symmetric = 0.5 * (second + np.swapaxes(second, 0, 1))[first, other]
    pairs = symmetric * np.where(first == other, 0.5, 1.0)[:, None]
    share = (pairs * weight**2) @ slope
    later = np.minimum(first, other)[:, None] > np.arange(count)
    return TriangularMap(first, other, jnp.asarray(share * later))


SHAPES = 48
"""Most shapes that are kept. Their number does not depend on the data, so that programs serve for all."""


class Bend(NamedTuple):
    """Second derivatives: products v_first v_second (q,) times ``share`` (q, k) times ``shape`` (k, m)."""

    first: np.ndarray
    second: np.ndarray
    share: Float[Array, "q k"]
    shape: Float[Array, "k m"]


class Surrogate(eqx.Module):
    """Log density over t (n + 2,); ``rows`` (m,) and ``slope`` (m, n) are the model's at v = 0.

    t is in standard deviations, rows are in the unit of their reading.
    """

    likelihood: Likelihood
    prior: Prior
    centre: Float[Array, " n+2"]
    scale: Float[Array, "n+2 n+2"]
    rows: Float[Array, " m"]
    slope: Float[Array, "m n"]
    bend: Bend
    map: TriangularMap

    def point(self, t: Float[Array, " n+2"]) -> Float[Array, " n+2"]:
        """The point of the posterior [free coordinates, 1] at ``t`` in standard deviations."""
        return self.centre + self.scale @ self._straight(t)

    def predicted(self, t: Float[Array, " n+2"]) -> Float[Array, " m"]:
        """The rows of the likelihood [unit of the reading] at ``t``, to second order."""
        return self.rows_at(self._straight(t)[: -len(NUISANCE)])

    def rows_at(self, v: Float[Array, " n"]) -> Float[Array, " m"]:
        """The rows of the likelihood [unit of the reading] at ``v`` in standard deviations, to second order."""
        products = v[self.bend.first] * v[self.bend.second]
        return self.rows + self.slope @ v + (products @ self.bend.share) @ self.bend.shape

    def __call__(self, t: Float[Array, " n+2"]) -> Float[Array, ""]:
        """The log density, up to a constant."""
        point = self.point(t)
        return self.likelihood(self.predicted(t), point) + self.prior(point)

    def points(self, ts: Float[np.ndarray, "*w n+2"]) -> Float[np.ndarray, "*w n+2"]:
        """The points at several t, which are in standard deviations."""
        flat = jnp.asarray(ts).reshape(-1, self.centre.size)
        return np.asarray(_points(self, flat)).reshape(ts.shape)

    def coordinates(self, points: Float[np.ndarray, "w n+2"]) -> Float[np.ndarray, "w n+2"]:
        """The t of several points, in standard deviations."""
        v = np.linalg.solve(np.asarray(self.scale), (points - np.asarray(self.centre)).T).T
        split = v.shape[1] - len(NUISANCE)
        return np.concatenate([self.map.inverse(v[:, :split]), v[:, split:]], axis=1)

    def _straight(self, t: Array) -> Array:
        split = t.size - len(NUISANCE)
        return jnp.concatenate([self.map(t[:split]), t[split:]])


@eqx.filter_jit
def _points(surrogate: Surrogate, ts: Array) -> Array:
    return jax.vmap(surrogate.point)(ts)


def no_bend(rows: int) -> Bend:
    """Second derivatives of a linear surrogate."""
    nothing = np.zeros(0, dtype=int)
    return Bend(nothing, nothing, jnp.zeros((0, 0)), jnp.zeros((0, rows)))


def bend_of(second: Float[np.ndarray, "n n m"], weight: Float[np.ndarray, " m"]) -> Bend:
    """The bend of second derivatives in v, symmetrised; ``weight`` (m,) is one over the rows' deviations.

    v is in standard deviations.
    """
    symmetric = 0.5 * (second + np.swapaxes(second, 0, 1))
    first, other = np.triu_indices(symmetric.shape[0])
    pairs = symmetric[first, other] * np.where(first == other, 0.5, 1.0)[:, None] * weight
    left, sizes, right = np.linalg.svd(pairs, full_matrices=False)
    share = left[:, :SHAPES] * sizes[:SHAPES]
    return Bend(first, other, jnp.asarray(share), jnp.asarray(right[:SHAPES] / weight))
