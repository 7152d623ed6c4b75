"""What the instruments see of a motion: sprung-mass accelerometer and suspension potentiometer."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.model.kinematics import suspension_travel
from savgs_ident.model.values import Values

RESPONSE_CHANNELS = ("sprung_accel", "susp_deflection")
"""The channels that a model predicts, in the order of :class:`Readings`."""


TINY = 1e-12
"""Shortest time between two readings [s]: a record of one instant has none."""


class Readings(NamedTuple):
    """Sprung-mass acceleration [m/s^2] and suspension deflection [m], as indicated.

    The deflection counts from the drawing's nominal state; a recording counts from its own standstill, so the
    means of the two are not comparable, everything else is.
    """

    sprung_accel: Float[Array, ""]
    susp_deflection: Float[Array, ""]


def read_sensors(p: Values, theta_LW: Float[Array, ""], acceleration: Float[Array, ""]) -> Readings:
    """Indicated values at a wishbone angle [rad] and a sprung-mass acceleration [m/s^2], gains included."""
    return Readings(p["accel_gain"] * acceleration, p["deflection_gain"] * suspension_travel(p, theta_LW))


def pass_through(
    transfer: Callable[[Float[Array, " f"]], Complex[Array, "C f"]], times: Float[Array, " n"], seen: Readings
) -> Readings:
    """Readings at evenly spaced ``times`` [s], (n,) each, after the dynamics of the sensors.

    ``transfer`` is reading over truth of both channels at frequencies [Hz]. Before and after the record the truth
    counts as what it was at its ends.
    """
    count = times.shape[0]
    rest = count // 2
    total = count + 2 * rest
    step = (times[-1] - times[0]) / max(count - 1, 1)
    padded = jnp.pad(jnp.stack(seen), ((0, 0), (rest, rest)), mode="edge")
    frequency = jnp.arange(total // 2 + 1, dtype=step.dtype) / (jnp.maximum(step, TINY) * total)
    shown = jnp.fft.irfft(jnp.fft.rfft(padded) * transfer(frequency), total)
    return Readings(*shown[:, rest : rest + count])
