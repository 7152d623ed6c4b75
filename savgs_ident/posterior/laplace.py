"""The posterior's scale about a point: a normal approximation, which makes it round for the samplers."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.posterior.prior import Prior

LONGEST = 1.0
"""Longest axis [unconstrained coordinates]: an e-fold of an identified parameter, a tolerance of the others. A
direction that the data do not tell is explored by as much."""

LEAST = 1e-4
"""Least standard deviation of a scale's coordinate."""

_NOISE_GRID = np.linspace(-4.0, 4.0, 161)
_MISS_GRID = np.concatenate([[0.0], np.geomspace(1e-5, 30.0, 300)])


def parameter_scale(
    likelihood: Likelihood, prior: Prior, point: Float[Array, " n+2"], slopes: Float[np.ndarray, "m n"]
) -> Float[np.ndarray, "n n"]:
    """Columns along the principal axes of the parameters' information at ``point``, one sd long each, or shorter."""
    count = slopes.shape[1]
    weight = 1.0 / np.sqrt(np.asarray(likelihood.spread(point)))
    curvature = -np.diag(np.asarray(jax.hessian(prior)(point)))[:count]
    stacked = np.concatenate([slopes * weight[:, None], np.diag(np.sqrt(np.maximum(curvature, 0.0)))])
    _, sizes, axes = np.linalg.svd(stacked, full_matrices=False)
    return np.asarray(axes.T / np.maximum(sizes, 1.0 / LONGEST))


def nuisance_scale(
    likelihood: Likelihood, prior: Prior, point: Float[Array, " n+2"], rows: Float[np.ndarray, " m"]
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Means and standard deviations of the noise's and the discrepancy's coordinate, given all others.

    The discrepancy's density is even in its coordinate. Where it stands clear of zero one of its two halves
    is taken, elsewhere both together.
    """
    modelled = jnp.asarray(rows)

    def moments(place: int, grid: np.ndarray) -> tuple[float, float]:
        logs = np.asarray(_log_densities(likelihood, prior, modelled, _along(point, place, grid)))
        mass = np.exp(logs - logs.max()) * np.gradient(grid)
        mass /= mass.sum()
        mean = float(mass @ grid)
        # A density narrower than the grid still has a width.
        return mean, max(float(np.sqrt(mass @ (grid - mean) ** 2)), LEAST)

    noise, miss = moments(-2, _NOISE_GRID), moments(-1, _MISS_GRID)
    if miss[0] < 3.0 * miss[1]:
        miss = (0.0, float(np.hypot(*miss)))
    return np.array([noise[0], miss[0]]), np.array([noise[1], miss[1]])


@eqx.filter_jit
def _log_densities(likelihood: Likelihood, prior: Prior, rows: Array, points: Array) -> Array:
    return jax.vmap(lambda point: likelihood(rows, point) + prior(point))(points)


def _along(point: Array, place: int, grid: np.ndarray) -> Array:
    """Copies of a point with one coordinate on a grid, (grid, n + 2)."""
    return jnp.tile(point, (grid.size, 1)).at[:, place].set(jnp.asarray(grid))
