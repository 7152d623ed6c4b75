"""Points of the posterior as values of parameters."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.posterior.scales import NUISANCE, Scales


def values_of(
    free: FreeVector, scales: Scales, points: Float[np.ndarray, "*w n+2"]
) -> dict[str, NDArray[np.float64]]:
    """Points as SI values by name, ``(*w,)`` each, the nuisance scales after the parameters."""
    flat = jnp.asarray(points.reshape(-1, points.shape[-1]))
    values = {name: np.asarray(each) for name, each in _constrained(free, flat[:, :-2]).items()}
    values |= dict(
        zip(NUISANCE, (np.asarray(scales.noise_scale(flat)), np.asarray(scales.miss(flat))), strict=True)
    )
    return {name: each.reshape(points.shape[:-1]) for name, each in values.items()}


@eqx.filter_jit
def _constrained(free: FreeVector, us: Array) -> dict[str, Array]:
    return jax.vmap(free.to_constrained)(us)
