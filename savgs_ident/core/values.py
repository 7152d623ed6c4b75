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
    # All numbers in one go: there are more than a hundred, and one at a time takes a hundred times as long.
    numbers = {n: np.asarray(v, np.float64) for n, v in values.items() if not isinstance(v, jax.Array)}
    moved = jax.device_put(numbers)
    return {
        name: moved[name] if name in moved else jnp.asarray(value, jnp.float64)
        for name, value in values.items()
    }
