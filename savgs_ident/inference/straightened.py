"""Coordinates of a posterior in which the ridges that scalings leave open are straight.

Where all forces grow together, masses, springs, damping and friction, motions stay as they are: data that say k / m
to five digits may leave both open by five per cent. Along such a scaling the logarithms of all of them change alike.
The coordinates in which parameters are estimated (:mod:`savgs_ident.core.transforms`) are no logarithms where a
tolerance or two bounds are known: in them the ridge bends, to every order, by many times its width.
"""

from math import log

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.inference.prior import NUISANCE

STRAIGHT = 2.0
"""Factor on either side of the centre within which coordinates are logarithms. Nearer to a bound other than zero a
parameter keeps its own coordinate, the logarithm of the distance to that. Origin: by choice, no posterior that is
normal about its mode is wider."""


_EDGE = log(STRAIGHT)


class Straightened(eqx.Module):
    """Coordinates y (n + 2,) about a ``centre`` in u that are logarithms of the parameters that are positive.

    Within :data:`STRAIGHT`, y times ``rate`` (n + 2,) [1] is the logarithm of the value over that in the centre;
    outside, y goes on as u does. Where nothing is straightened, the rate is 0 and y = u - centre. In the centre
    dy / du = 1.
    """

    free: FreeVector
    centre: Float[Array, " n+2"]
    rate: Float[Array, " n+2"]

    def points(self, y: Float[Array, " n+2"]) -> Float[Array, " n+2"]:
        """The points [free coordinates, 1] at ``y``, (n + 2,)."""
        within, beyond, _ = self._within(y)
        return jnp.where(self.rate > 0.0, self._padded(within) + beyond, self.centre + y)

    def slopes(self, y: Float[Array, " n+2"]) -> Float[Array, " n+2"]:
        """du / dy [1], (n + 2,)."""
        return self._within(y)[2]

    def coordinates(self, point: Float[Array, " n+2"]) -> Float[Array, " n+2"]:
        """The y [1] of a ``point``, (n + 2,)."""
        count = point.size - len(NUISANCE)
        edges = [self._u_at(edge * jnp.ones(point.size)) for edge in (-_EDGE, _EDGE)]
        within = jnp.clip(point[:count], *edges)
        values = jnp.stack(list(self.free.to_constrained(within).values()))
        known = self.rate[:count] > 0.0
        ratio = jnp.where(known, values, 1.0) / jnp.where(known, self._values, 1.0)
        log_value = self._padded(jnp.log(ratio))
        y = (log_value + self._padded(point[:count] - within) * self._steepness(within)) / self._rates
        return jnp.where(self.rate > 0.0, y, point - self.centre)

    @property
    def _values(self) -> Array:
        """The parameters in the centre [SI unit of each], (n,)."""
        return jnp.stack(list(self.free.to_constrained(self.centre[: -len(NUISANCE)]).values()))

    @property
    def _rates(self) -> Array:
        return jnp.where(self.rate > 0.0, self.rate, 1.0)

    def _u_at(self, logarithm: Array) -> Array:
        """The u (n,) where logarithms of values are so far above the centre's; elsewhere the centre's."""
        count = logarithm.size - len(NUISANCE)
        known = self.rate[:count] > 0.0
        values = self._values * jnp.exp(jnp.where(known, logarithm[:count], 0.0))
        return jnp.where(known, self.free.coordinates(values), self.centre[:count])

    def _steepness(self, u: Array) -> Array:
        """d log value / du [1], (n + 2,)."""
        values = jnp.stack(list(self.free.to_constrained(u).values()))
        slopes = self.free.jacobian_diag(u)
        return jnp.concatenate([slopes / jnp.where(values == 0.0, 1.0, values), jnp.ones(len(NUISANCE))])

    def _within(self, y: Array) -> tuple[Array, Array, Array]:
        """The u (n,) within the edges, by how much (n + 2,) it is beyond, and du / dy there."""
        asked = self.rate * y
        logarithm = jnp.clip(asked, -_EDGE, _EDGE)
        u = self._u_at(logarithm)
        steepness = jnp.where(self.rate > 0.0, self._steepness(u), 1.0)
        return u, (asked - logarithm) / steepness, jnp.where(self.rate > 0.0, self.rate / steepness, 1.0)

    @staticmethod
    def _padded(values: Array) -> Array:
        return jnp.concatenate([values, jnp.zeros(len(NUISANCE))])


def straightened_about(free: FreeVector, centre: Float[np.ndarray, " n+2"]) -> Straightened:
    """The straightened coordinates of points about ``centre`` (n + 2,)."""
    u = jnp.asarray(centre[: -len(NUISANCE)])
    values = np.array([float(each) for each in free.to_constrained(u).values()])
    slopes = np.asarray(free.jacobian_diag(u))
    rate = np.zeros(centre.size)
    for place, (each, value) in enumerate(zip(free.parameters, values, strict=True)):
        positive = max(each.lower, 0.0) * STRAIGHT < value and value * STRAIGHT < each.upper
        if each.lower >= 0.0 and positive and not each.is_typical:
            rate[place] = slopes[place] / value
    return Straightened(free, jnp.asarray(centre), jnp.asarray(rate))
