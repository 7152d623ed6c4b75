"""The model about its posterior's mode: exact near it, and what a sampler proposes from.

The normal approximation there gives the scale of the posterior about a point, in which it is round for the samplers;
second derivatives are differences of exact slopes, and along axes that bend rows are exact further out, too.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.presentation import Progress
from savgs_ident.core.threads import in_parallel
from savgs_ident.inference.laplace import principal_axes
from savgs_ident.inference.likelihood import RowLikelihood
from savgs_ident.inference.near_mode import (
    PLACES,
    ExactModel,
    LinearisationPoint,
    Surrogate,
    bend_of,
    curve_of,
    identity_map,
    no_bend,
    no_curve,
    triangular_map_of,
)
from savgs_ident.inference.posterior_mode import PosteriorDensity
from savgs_ident.inference.prior import Prior
from savgs_ident.inference.straightened import straightened_about

LONGEST = 1.0
"""Longest axis [unconstrained coordinates]: an e-fold of an identified parameter, a tolerance of the others. A
direction that the data do not identify is explored by as much."""

LEAST = 1e-4
"""Least standard deviation of a scale's coordinate."""

_NOISE_GRID = np.linspace(-4.0, 4.0, 161)
"""Coordinates of the noise's scale about that of the mode, which lies far off where the model misses by far."""
_MISS_GRID = np.concatenate([[0.0], np.geomspace(1e-5, 30.0, 300)])
"""Coordinates of the discrepancy, or multiples of that of the mode where it is above one."""


def parameter_scale(
    likelihood: RowLikelihood, prior: Prior, point: Float[Array, " n+2"], slopes: Float[np.ndarray, "m n"]
) -> Float[np.ndarray, "n n"]:
    """Columns along the principal axes of the parameters' information at ``point``, one sd long each, or shorter."""
    count = slopes.shape[1]
    weight = 1.0 / np.sqrt(np.asarray(likelihood.spread(point)))
    curvature = -np.diag(np.asarray(jax.hessian(prior)(point)))[:count]
    stacked = np.concatenate([slopes * weight[:, None], np.diag(np.sqrt(np.maximum(curvature, 0.0)))])
    return principal_axes(stacked, LONGEST)


def nuisance_scale(
    likelihood: RowLikelihood,
    prior: Prior,
    point: Float[Array, " n+2"],
    rows: Float[np.ndarray, " m"],
    scatter: Float[np.ndarray, " m"],
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Means and standard deviations of the noise's and the discrepancy's coordinate, given all others.

    The discrepancy's density is even in its coordinate. Where it stands clear of zero one of its two halves
    is taken, elsewhere both together, as wide as they are where ``rows`` of the mode miss by their ``scatter`` (m,)
    over the posterior besides: at the mode they miss least, and leave the least room for it.
    """
    measured = np.asarray(likelihood.measured)

    def moments(place: int, grid: np.ndarray, modelled: np.ndarray = rows) -> tuple[float, float]:
        along = _along(point, place, grid)
        logs = np.asarray(_log_densities(likelihood, prior, jnp.asarray(modelled), along))
        mass = np.exp(logs - logs.max()) * np.gradient(grid)
        mass /= mass.sum()
        mean = float(mass @ grid)
        # A density narrower than the grid still has a width.
        return mean, max(float(np.sqrt(mass @ (grid - mean) ** 2)), LEAST)

    level, size = (float(each) for each in np.asarray(point)[-2:])
    missing = _MISS_GRID * max(1.0, abs(size))
    noise, miss = moments(-2, level + _NOISE_GRID), moments(-1, missing)
    if miss[0] < 3.0 * miss[1]:
        anywhere = measured + np.hypot(rows - measured, scatter)
        miss = (0.0, float(np.hypot(*moments(-1, missing, anywhere))))
    return np.array([noise[0], miss[0]]), np.array([noise[1], miss[1]])


@eqx.filter_jit
def _log_densities(likelihood: RowLikelihood, prior: Prior, rows: Array, points: Array) -> Array:
    return jax.vmap(lambda point: likelihood(rows, point) + prior(point))(points)


def _along(point: Array, place: int, grid: np.ndarray) -> Array:
    """Copies of a point with one coordinate on a grid, (grid, n + 2)."""
    return jnp.tile(point, (grid.size, 1)).at[:, place].set(jnp.asarray(grid))


def linear_surrogate(posterior: PosteriorDensity, at: LinearisationPoint) -> Surrogate:
    """The surrogate about a linearisation point, without second derivatives."""
    point = jnp.asarray(at.point)
    scale = np.zeros((point.size, point.size))
    scale[:-2, :-2] = parameter_scale(posterior.likelihood, posterior.prior, point, at.slopes)
    slope = at.slopes @ scale[:-2, :-2]
    scatter = np.linalg.norm(slope, axis=1)
    means, spreads = nuisance_scale(posterior.likelihood, posterior.prior, point, at.rows, scatter)
    scale[[-2, -1], [-2, -1]] = spreads
    return Surrogate(
        likelihood=posterior.likelihood,
        prior=posterior.prior,
        straightened=straightened_about(posterior.prior.free, np.concatenate([at.point[:-2], means])),
        scale=jnp.asarray(scale),
        rows=jnp.asarray(at.rows),
        slope=jnp.asarray(slope),
        bend=no_bend(at.rows.size),
        curve=no_curve(slope.shape[1], at.rows.size),
        map=identity_map(slope.shape[1]),
        middle=jnp.zeros(point.size),
        width=jnp.ones(point.size),
    )


BENT = 0.5
"""Second derivative [noise sd] beyond which an axis is explored to its other side too."""


CURVED = 0.1
"""Second derivative [noise sd] beyond which rows along an axis are exact further out, too. Origin: three standard
deviations away it makes half a one of the rows."""


class Expansion(NamedTuple):
    """The model about a point: exact near it, and a surrogate to second order."""

    exact: ExactModel
    surrogate: Surrogate


def expand(posterior: PosteriorDensity, at: LinearisationPoint, report: Progress) -> Expansion:
    """The expansion about a linearisation point."""
    linear = linear_surrogate(posterior, at)
    axes = np.asarray(linear.scale)[:-2, :-2]
    weight = 1.0 / np.sqrt(np.asarray(posterior.likelihood.spread(linear.centre)))
    report(f"second derivatives of the response along {axes.shape[1]} axes")
    exact = posterior.problem.exact(posterior.likelihood, jnp.asarray(at.point[:-2]), at.warm_start)
    second = _second_derivatives(posterior, at, exact, linear, weight)
    bent = (bend_of(second, weight), triangular_map_of(second, np.asarray(linear.slope), weight))
    quadratic: Surrogate = eqx.tree_at(lambda each: (each.bend, each.map), linear, bent)
    own = np.linalg.norm(np.einsum("iim->im", second) * weight, axis=1)
    axes_that_bend = np.flatnonzero(own > CURVED)
    report(f"responses further out along {axes_that_bend.size} axes that bend")
    left = _left_along_axes(exact, quadratic, axes_that_bend)
    return Expansion(exact, eqx.tree_at(lambda each: each.curve, quadratic, curve_of(left, weight)))


def _left_along_axes(
    exact: ExactModel, surrogate: Surrogate, bent: Float[np.ndarray, " b"]
) -> Float[np.ndarray, "n 6 m"]:
    """What a surrogate leaves of the rows at the places along its axes, of those that ``bent``.

    Where the model is not solved, further out than the last place where it was, as much as there, by v^2.
    """
    count = surrogate.slope.shape[1]
    left = np.zeros((count, PLACES.size, surrogate.rows.size))
    if not bent.size:
        return left
    v = np.zeros((bent.size, PLACES.size, count + 2))
    v[np.arange(bent.size), :, bent] = PLACES
    points, made_up = (np.asarray(each) for each in _at(surrogate, jnp.asarray(v.reshape(-1, count + 2))))
    rows, solved = exact.rows(points[:, :-2])
    left[bent] = np.where(solved[:, None], rows - made_up, np.nan).reshape(bent.size, PLACES.size, -1)
    middle = PLACES.size // 2
    for outward in (range(middle, PLACES.size), range(middle - 1, -1, -1)):
        inner = np.zeros((count, surrogate.rows.size))
        for place in outward:
            inner = np.where(np.isfinite(left[:, place]), left[:, place] / PLACES[place] ** 2, inner)
            left[:, place] = inner * PLACES[place] ** 2
    return left


@eqx.filter_jit
def _at(surrogate: Surrogate, v: Array) -> tuple[Array, Array]:
    """Points and rows of a surrogate at ``v`` (w, n + 2) in standard deviations."""
    points = jax.vmap(lambda each: surrogate.straightened.points(surrogate.scale @ each))(v)
    return points, jax.vmap(surrogate.rows_at)(v[:, :-2])


def _second_derivatives(
    posterior: PosteriorDensity,
    at: LinearisationPoint,
    exact: ExactModel,
    linear: Surrogate,
    weight: Float[np.ndarray, " m"],
) -> Float[np.ndarray, "n n m"]:
    """Differences of the slopes one standard deviation ahead; of both sides where an axis bends much.

    An axis whose sides were not solved counts as straight: the exact model decides in the end.
    """
    axes, straightened = np.asarray(linear.scale)[:-2, :-2], linear.straightened

    def slopes_at(shift: np.ndarray) -> np.ndarray | None:
        y = jnp.append(jnp.asarray(shift), jnp.zeros(2))
        u = straightened.points(y)[:-2]
        found = posterior.problem.linear_rows(posterior.likelihood, u, at.warm_start, exact.predicted(u))
        by_axis = (found.slopes * np.asarray(straightened.slopes(y))[:-2]) @ axes
        return np.asarray(by_axis.T) if found.status.ok else None

    here = (at.slopes @ axes).T
    ahead = in_parallel(slopes_at, axes.T)
    second = np.stack([np.zeros_like(here) if each is None else each - here for each in ahead])
    bent = [
        axis
        for axis, each in enumerate(ahead)
        if each is None or not np.linalg.norm(second[axis, axis] * weight) < BENT
    ]
    for axis, behind in zip(bent, in_parallel(slopes_at, [-axes.T[axis] for axis in bent]), strict=True):
        if behind is None:
            second[axis] = 0.0
        else:
            second[axis] = here - behind if ahead[axis] is None else 0.5 * (second[axis] + here - behind)
    return np.nan_to_num(second)
