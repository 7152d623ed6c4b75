"""What the instruments see of a motion: sprung-mass accelerometer and suspension potentiometer."""

from typing import NamedTuple

from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.kinematics import suspension_travel

RESPONSE_CHANNELS = ("sprung_accel", "susp_deflection")
"""The channels that a model predicts, in the order of :class:`Readings`."""


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
