"""Surrogates of the toy, right ones and such that are off on purpose."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from savgs_ident.inference.expansion import linear_surrogate
from savgs_ident.inference.near_mode import Surrogate, bend_of, triangular_map_of
from savgs_ident.inference.posterior_mode import LinearisationPoint, PosteriorDensity
from savgs_ident.inference.prior import Prior

from .toy import Toy


class Stand(NamedTuple):
    """A surrogate, the density that it stands in for, and the point (n + 2,) that it was made about."""

    posterior: PosteriorDensity
    surrogate: Surrogate
    point: NDArray[np.float64]


def density_of(toy: Toy) -> PosteriorDensity:
    """The density of the toy's posterior."""
    return PosteriorDensity(toy.problem, toy.likelihood, Prior(toy.problem.free))  # type: ignore[arg-type]


def mode_of(toy: Toy) -> NDArray[np.float64]:
    """The mode of the exact density, (n + 2,), the discrepancy's coordinate positive."""
    posterior = density_of(toy)

    @jax.jit
    def density(rows: jax.Array, point: jax.Array) -> jax.Array:
        return posterior.likelihood(rows, point) + posterior.prior(point)

    slopes_of = jax.jit(jax.grad(density, argnums=(0, 1)))

    def depth(point: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        rows = jnp.asarray(toy.rows(point[None, :-2])[0][0])
        by_rows, by_point = (np.array(each) for each in slopes_of(rows, jnp.asarray(point)))
        by_point[:-2] += by_rows @ toy.slopes(point[:-2])
        return -float(density(rows, jnp.asarray(point))), -by_point

    start = np.zeros(len(toy.problem.free.names) + 2)
    start[-1] = 0.5
    found = minimize(depth, start, jac=True, method="BFGS", options={"gtol": 1e-7})
    return np.append(found.x[:-1], abs(found.x[-1]))


def stand_for(toy: Toy, slope_share: float = 1.0, bend_share: float = 1.0) -> Stand:
    """The surrogate about the mode, with this share of its slopes and second derivatives there.

    The toy is a polynomial of u: the surrogate is one of the same, not of straightened coordinates.
    """
    posterior, point = density_of(toy), mode_of(toy)
    rows = toy.rows(point[None, :-2])[0][0]
    slopes = slope_share * toy.slopes(point[:-2])
    linear = linear_surrogate(posterior, LinearisationPoint(point, rows, slopes, None, 0.0))  # type: ignore[arg-type]
    linear = eqx.tree_at(lambda each: each.straightened.rate, linear, jnp.zeros(point.size))
    axes = np.asarray(linear.scale)[:-2, :-2]
    weight = 1.0 / np.sqrt(np.asarray(toy.likelihood.spread(linear.centre)))
    at_point = toy.bend.copy()
    at_point[0, 0] += 6.0 * point[0] * toy.cubic
    second = bend_share * np.einsum("ia,jb,ijm->abm", axes, axes, at_point)
    bent = (bend_of(second, weight), triangular_map_of(second, np.asarray(linear.slope), weight))
    return Stand(posterior, eqx.tree_at(lambda each: (each.bend, each.map), linear, bent), point)


def normal_covariance(toy: Toy) -> NDArray[np.float64]:
    """Covariance of u, (n, n), of a linear toy whose scales are known and whose identified priors are flat."""
    weight = 1.0 / np.asarray(toy.likelihood.variance)
    information = toy.slope.T @ (weight[:, None] * toy.slope)
    count = len(toy.problem.free.identified)
    information += np.diag(np.where(np.arange(len(information)) < count, 0.0, 1.0))
    return np.asarray(np.linalg.inv(information))
