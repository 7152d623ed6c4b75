"""An accelerometer that is not upright: it sees the share of the vertical along its axis.

    reading / truth = cos(tilt) = 1 - v

with the versine v = 1 - cos(tilt) [1], in which the reading is linear; 0.0075 is 7 deg, and hardly anyone mounts a
sensor further off. It looks like a gain below one, and nothing in the readings can tell the two apart.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSensorFault, InternalState, Port
from savgs_ident.model.values import Values


class AccelTilt(AbstractSensorFault):
    """A tilted accelerometer."""

    name: ClassVar[str] = "accel_tilt"
    port: ClassVar[Port] = Port.SENSOR_SPRUNG_ACCEL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "accel_tilt_versine",
            0.0075,
            "1",
            lower=0.0,
            upper=0.5,
            about="one less the cosine of the accelerometer's tilt",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"accel_tilt_versine": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the acceleration alone is too small by the same share in every test and order"
    reference: ClassVar[str] = (
        "Titterton and Weston 2004, Strapdown Inertial Navigation Technology, on misalignment"
    )

    def transfer(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        cosine = (1.0 - p["accel_tilt_versine"]) * jnp.ones_like(frequency)
        return cosine.astype(jnp.complex128)
