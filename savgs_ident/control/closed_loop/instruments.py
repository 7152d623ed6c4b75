"""What the controller's inputs are made of: noise and steps of the instruments."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

NUMBER = 3
"""Instruments: accelerometer, potentiometer, encoder of the motor."""


class Instruments(eqx.Module):
    """Noise (standard deviation) and step of the accelerometer [m/s^2], potentiometer [m] and link angle [rad]."""

    noise: Float[Array, "3"]
    step: Float[Array, "3"]

    def read(self, truth: Float[Array, "3"], normal: Float[Array, "3"]) -> Float[Array, "3"]:
        """Readings of true values, both in SI, with standard normal numbers for the noise."""
        noisy = truth + self.noise * normal
        fine = jnp.where(self.step > 0.0, self.step, 1.0)
        return jnp.where(self.step > 0.0, fine * jnp.round(noisy / fine), noisy)


def sheet_instruments(gear_ratio: float) -> Instruments:
    """The rig's: noise from its data sheet, 16-bit converters over 10 g and 0.3 m, 65536 counts per motor turn.

    ``gear_ratio`` [1] is that of motor to link.
    """
    counts = 65536.0
    return Instruments(
        jnp.array([0.05, 1e-4, 0.0]),
        jnp.array([2.0 * 98.1 / counts, 0.3 / counts, 2.0 * np.pi / counts / gear_ratio]),
    )


def ideal_instruments() -> Instruments:
    """Neither noise nor steps."""
    return Instruments(jnp.zeros(3), jnp.zeros(3))
