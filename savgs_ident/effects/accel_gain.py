"""Gain error of the sprung-mass accelerometer, beyond its tolerance.

    reading / truth = 1 + e

at every frequency.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSensorFault, InternalState, Port
from savgs_ident.model.values import Values


class AccelGain(AbstractSensorFault):
    """An accelerometer that shows too much or too little."""

    name: ClassVar[str] = "accel_gain"
    port: ClassVar[Port] = Port.SENSOR_SPRUNG_ACCEL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "accel_gain_error",
            0.05,
            "1",
            lower=-0.9,
            upper=2.0,
            about="relative gain error of the accelerometer",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"accel_gain_error": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the acceleration alone is too large or too small by the same share in every test and order"
    )
    reference: ClassVar[str] = "ISO 16063-21, calibration of vibration transducers by comparison"

    def transfer(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        gain = (1.0 + p["accel_gain_error"]) * jnp.ones_like(frequency)
        return gain.astype(jnp.complex128)
