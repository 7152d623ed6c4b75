"""A cheap stand-in for the model near its posterior's mode: the rows of the likelihood to second order.

With v one standard deviation along the principal axes, point = centre + scale v, the rows are

    rows(v) = rows + slope v + 1/2 sum_ij v_i v_j bend_ij,

and a shear (:mod:`savgs_ident.posterior.shear`) leads to coordinates t in which the posterior is nearly a unit
normal. The slopes are exact, the second derivatives their differences one standard deviation away. They are kept in a
few shapes only (the leading ones of a singular value decomposition). A surrogate proposes; the exact model decides.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.posterior.prior import Prior
from savgs_ident.posterior.scales import NUISANCE
from savgs_ident.posterior.shear import Shear

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
    shear: Shear

    def point(self, t: Float[Array, " n+2"]) -> Float[Array, " n+2"]:
        """The point of the posterior [free coordinates, 1] at ``t`` in standard deviations."""
        return self.centre + self.scale @ self._straight(t)

    def predicted(self, t: Float[Array, " n+2"]) -> Float[Array, " m"]:
        """The rows of the likelihood [unit of the reading] at ``t``, to second order."""
        v = self._straight(t)[: -len(NUISANCE)]
        products = v[self.bend.first] * v[self.bend.second]
        return self.rows + self.slope @ v + (products @ self.bend.share) @ self.bend.shape

    def __call__(self, t: Float[Array, " n+2"]) -> Float[Array, ""]:
        """The log density, up to a constant."""
        point = self.point(t)
        return self.likelihood(self.predicted(t), point) + self.prior(point)

    @property
    def start(self) -> Float[np.ndarray, " n+2"]:
        """Where to look for the top from, in standard deviations.

        Off the symmetry plane of the discrepancy, which is a saddle.
        """
        t = np.zeros(self.centre.size)
        t[-1] = 1.0
        return t

    def points(self, ts: Float[np.ndarray, "*w n+2"]) -> Float[np.ndarray, "*w n+2"]:
        """The points at several t, which are in standard deviations."""
        flat = jnp.asarray(ts).reshape(-1, self.centre.size)
        return np.asarray(_points(self, flat)).reshape(ts.shape)

    def coordinates(self, points: Float[np.ndarray, "w n+2"]) -> Float[np.ndarray, "w n+2"]:
        """The t of several points, in standard deviations."""
        v = np.linalg.solve(np.asarray(self.scale), (points - np.asarray(self.centre)).T).T
        split = v.shape[1] - len(NUISANCE)
        return np.concatenate([self.shear.inverse(v[:, :split]), v[:, split:]], axis=1)

    def _straight(self, t: Array) -> Array:
        split = t.size - len(NUISANCE)
        return jnp.concatenate([self.shear(t[:split]), t[split:]])


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
