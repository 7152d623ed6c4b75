"""Parameter values as the model takes them, in double precision.

Importing this module turns on double precision in JAX: friction and hardpoints need it.
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

jax.config.update("jax_enable_x64", True)

Values = Mapping[str, Float[Array, ""]]
"""Parameter name to value in SI."""


def as_values(values: Mapping[str, float] | Values) -> dict[str, Float[Array, ""]]:
    """Numbers in SI by name as arrays of double precision.

    Python numbers would do, but each mix of numbers and arrays would be another program to compile.
    """
    numbers = {n: np.asarray(v, np.float64) for n, v in values.items() if not isinstance(v, jax.Array)}
    moved = dict(zip(numbers, _as_arrays([*numbers.values()]), strict=True))
    return {name: moved[name] if name in moved else _doubled(value) for name, value in values.items()}


@jax.jit
def _as_arrays(numbers: list[Float[Array, ""]]) -> list[Float[Array, ""]]:
    """Numbers of any units on their way into a program, which is left out: there is no quicker one for many."""
    return numbers


def _doubled(value: Float[Array, ""] | float) -> Float[Array, ""]:
    """An array of any unit in double precision, itself where it is in that."""
    if isinstance(value, jax.Array) and value.dtype == jnp.float64 and not value.weak_type:
        return value
    return jnp.asarray(value, jnp.float64)
