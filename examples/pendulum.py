"""A plant in sixty lines: a pendulum whose pivot is shaken.

    m L (L phidd + a cos phi + g sin phi) + c phid = torques of effects at the pivot

with the angle phi of the rod from the vertical, the horizontal acceleration a of the pivot, the mass m of the bob,
the length L of the rod and the viscous damping c of the bearing. What a plant declares: savgs_ident/plants/base.py.
"""

from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.effects.base import Number, Port, PortKind, PortSignals
from savgs_ident.plants.base import AbstractPlant, Channel, Coordinate, Input, Scalar


class Angle(NamedTuple):
    """Angle of the rod [rad], or a time derivative of it; also the reading of the encoder."""

    phi: Scalar


UNITS, SIZES = ("rad", "N m"), (0.1, 0.5, 0.02)
PIVOT = Port("pivot", PortKind.FORCE, "pivot", "angle of the rod; torque on it", *UNITS, *SIZES)
SHAKER = Port("shaker", PortKind.INPUT, "shaker", displacement_unit="m/s^2", displacement=0.05)
ROD = Port("rod", PortKind.NUMBER, "rod", numbers=(Number("L", "m", 0.01), Number("m", "kg", 0.02)))
ENCODER = Port("encoder", PortKind.SENSOR, "sensor.angle", displacement_unit="rad", displacement=1e-3)


class Pendulum(AbstractPlant):
    """The pendulum, plus the effects that were added to it."""

    coordinates: ClassVar = (Coordinate("phi", "rad", "angle of the rod", 0.1, 0.5, 3.0, travel=np.pi),)
    coordinate_type: ClassVar = Angle
    inputs: ClassVar = (Input("pivot_accel", "m/s^2", "acceleration of the pivot", moves=(0.1,)),)
    channels: ClassVar = (Channel("angle", "rad", "angle of the rod"),)
    ports: ClassVar = (PIVOT, SHAKER, ROD, ENCODER)
    parameters: ClassVar = ParameterTable(
        (
            Parameter("m", 0.5, "kg", tolerance=0.005, lower=0.0, about="mass of the bob"),
            Parameter("L", 0.4, "m", tolerance=0.004, lower=0.0, about="length of the rod"),
            Parameter("c", 0.02, "N m s/rad", lower=0.0, upper=1.0, about="damping of the bearing"),
            Parameter("g", 9.81, "m/s^2", about="acceleration of free fall"),
        )
    )

    def evaluate(self, p, motion, u, acting, prepared=None):
        """Torque out of balance [N m], and the torque at the pivot [N m]."""
        phi, rate, acceleration = motion.q.phi, motion.qd.phi, motion.qdd.phi
        none = jnp.zeros_like(phi)
        pivot = acting.input(SHAKER, u.signals[0], u.fundamental).value
        torque = acting.force(PIVOT, PortSignals(phi, rate, none, none)) - p["c"] * rate
        inertia = p["L"] * acceleration + pivot * jnp.cos(phi) + p["g"] * jnp.sin(phi)
        return jnp.stack([torque - p["m"] * p["L"] * inertia]), torque

    def read(self, p, motion, s, sd, u, prepared=None):
        """The angle."""
        return Angle(motion.q.phi)
