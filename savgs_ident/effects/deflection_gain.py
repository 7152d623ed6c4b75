"""Gain error of the suspension potentiometer, beyond its tolerance.

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


class DeflectionGain(AbstractSensorFault):
    """A potentiometer that shows too much or too little."""

    name: ClassVar[str] = "deflection_gain"
    port: ClassVar[Port] = Port.SENSOR_SUSP_DEFLECTION
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "deflection_gain_error",
            0.05,
            "1",
            lower=-0.9,
            upper=2.0,
            about="relative gain error of the potentiometer",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"deflection_gain_error": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the deflection alone is too large or too small by the same share in every test and order"
    )
    reference: ClassVar[str] = "Doebelin 2004, Measurement Systems, ch. 3, static calibration"

    def transfer(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        gain = (1.0 + p["deflection_gain_error"]) * jnp.ones_like(frequency)
        return gain.astype(jnp.complex128)
