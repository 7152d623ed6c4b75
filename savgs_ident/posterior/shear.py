"""Coordinates in which a bent posterior is round.

Where data tell a product of two parameters far better than either of them, the posterior is a thin banana,
and neither walks nor trajectories get along it. The rows' second derivatives say how it bends: by B(v, v) / 2,
most of which a change of the well-told coordinates can make up for. So with

    v_k = t_k - sum over i, j > k of share_ijk t_i t_j,

axes sorted from the best told to the least, the rows are nearly linear in t. As v_k depends on t_k and later
ones only, volumes stay as they are and the way back is one substitution after the other.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class Shear(eqx.Module):
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


def no_shear(size: int) -> Shear:
    """The map that leaves v = t."""
    nothing = np.zeros(0, dtype=int)
    return Shear(nothing, nothing, jnp.zeros((0, size)))


def shear_of(
    second: Float[np.ndarray, "n n m"], slope: Float[np.ndarray, "m n"], weight: Float[np.ndarray, " m"]
) -> Shear:
    """The shear that makes up for ``second`` derivatives in v of rows with ``slope`` in v.

    ``weight`` (m,) is one over the rows' deviations; columns of slope and prior together are orthonormal. v
    is in standard deviations.
    """
    count = second.shape[0]
    first, other = np.triu_indices(count)
    symmetric = 0.5 * (second + np.swapaxes(second, 0, 1))[first, other]
    pairs = symmetric * np.where(first == other, 0.5, 1.0)[:, None]
    share = (pairs * weight**2) @ slope
    later = np.minimum(first, other)[:, None] > np.arange(count)
    return Shear(first, other, jnp.asarray(share * later))
