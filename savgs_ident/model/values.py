"""Parameter values as the model takes them."""

from collections.abc import Mapping

import jax.numpy as jnp
from jaxtyping import Array, Float

Values = Mapping[str, Float[Array, ""]]
"""Parameter name to value in SI."""


def as_values(values: Mapping[str, float] | Values) -> dict[str, Float[Array, ""]]:
    """Numbers in SI by name as arrays of double precision.

    Python numbers would do, but each mix of numbers and arrays would be another program to compile.
    """
    return {name: jnp.asarray(value, dtype=jnp.float64) for name, value in values.items()}
