"""What is known before the data.

A point of the posterior is x = (u, a, b): the unconstrained coordinates of the parameters
(:class:`savgs_ident.core.free_vector.FreeVector`) and the coordinates a, b of the likelihood's scales
(:mod:`savgs_ident.posterior.scales`).

- An identified parameter is uniform between its bounds; on its logistic coordinate that is the logistic
  density. With one bound only, the same density makes its distance to the bound log-logistic: flat near the
  bound, the table's value for its median, and a tail like 1/x^2.
- A parameter known to a tolerance is normal: its coordinate is, with unit variance. So are a and b.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import logit, ndtri

from savgs_ident.core.bijection import TwoSided, identified_bijection
from savgs_ident.core.free_vector import FreeVector


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
