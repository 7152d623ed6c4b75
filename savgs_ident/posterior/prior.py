"""What is known before the data.

A point of the posterior is x = (u, a, b): the unconstrained coordinates of the parameters
(:class:`savgs_ident.core.free_vector.FreeVector`) and two coordinates of the likelihood's scales,

    noise scale = exp(0.1 a),    discrepancy = 0.05 |b|.

- An identified parameter is uniform between its bounds; on its logistic coordinate that is the logistic
  density. With one bound only, the same density makes its distance to the bound log-logistic: flat near the
  bound, the table's value for its median, and a tail like 1/x^2.
- A parameter known to a tolerance is normal: its coordinate is, with unit variance.
- The noise covariance was estimated from what does not repeat: its scale is trusted to 10 %.
- The discrepancy is half-normal with 5 %: a model that misses more than a tenth is the wrong model.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import logit, ndtri

from savgs_ident.core.bijection import TwoSided, identified_bijection
from savgs_ident.core.free_vector import FreeVector

NOISE_TRUST = 0.1
"""Standard deviation of the logarithm of the noise scale [1]."""

DISCREPANCY = 0.05
"""Scale of the half-normal prior of the model discrepancy [1]."""

NUISANCE = ("noise_scale", "discrepancy")
"""The scales of the likelihood, in the order of their coordinates, which come last in a point."""


class Prior(eqx.Module):
    """Log prior density of points (n + 2,), normalised up to a constant."""

    free: FreeVector
    offset: np.ndarray

    def __call__(self, point: Float[Array, " n+2"]) -> Float[Array, ""]:
        """The log density."""
        count = len(self.free.identified)
        logistic = point[:count] + self.offset
        normal = point[count:]
        return -jnp.sum(jax.nn.softplus(logistic) + jax.nn.softplus(-logistic)) - 0.5 * jnp.sum(normal**2)

    def quantile(self, share: float) -> Float[np.ndarray, " n"]:
        """The coordinates of the parameters below which ``share`` of each one's prior lies, (n,)."""
        tolerated = np.full(len(self.free.tolerated), ndtri(share))
        return np.concatenate([logit(share) - self.offset, tolerated])


def prior_of(free: FreeVector) -> Prior:
    """The prior of a free vector and the nuisance scales."""
    maps = [identified_bijection(parameter) for parameter in free.parameters[: len(free.identified)]]
    return Prior(free, np.array([each.offset if isinstance(each, TwoSided) else 0.0 for each in maps]))


def noise_scale(point: Float[Array, " n+2"]) -> Float[Array, ""]:
    """Factor on the measured noise's standard deviation [1]."""
    return jnp.exp(NOISE_TRUST * point[-2])


def discrepancy(point: Float[Array, " n+2"]) -> Float[Array, ""]:
    """Relative rms by which the model misses, beyond the noise [1]."""
    return DISCREPANCY * jnp.abs(point[-1])
