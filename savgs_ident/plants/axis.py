"""One servo axis: a carriage on a guide, moved through a screw by the force of a motor.

    M xdd = u - K x - F_v xd + f

with the position x, the mass M that the motor feels, the viscous friction F_v, the drive force u beyond that of a
position loop of stiffness K, and f what effects add at the ports: dry friction on the guide, a spring or a stop on
the screw. K is zero where u is the whole force, as in a recording of the drive: then the motion is not periodic under
a periodic force, but the force that the measured motion needs can be compared with the one recorded.

Source: Janot, Gautier and Brunot 2019, Data set and reference models of EMPS, nonlinearbenchmark.org.
"""

from typing import ClassVar, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import TYPICAL, Parameter, ParameterTable
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Number, Port, PortKind, PortSignals
from savgs_ident.effects.composition import EffectsAtInstant
from savgs_ident.plants.base import AbstractPlant, Channel, Coordinate, Input, Inputs, Motion, Scalar


class Position(NamedTuple):
    """Position of the carriage [m], or a time derivative of it."""

    x: Scalar


class Readings(NamedTuple):
    """Position of the carriage [m]."""

    position: Scalar


class Loads(NamedTuple):
    """Forces on the carriage [N]: of the drive, of the guide with its viscous friction, of the screw."""

    drive: Scalar
    guide: Scalar
    screw: Scalar


GUIDE = Port(
    "guide",
    PortKind.FORCE,
    "guide",
    about="position; force on the carriage along it; load its weight",
    displacement=1e-3,
    velocity=0.1,
    force=20.0,
    loaded=True,
    contact=("k_pre", "c_pre"),
)
LUBRICANT = Port(
    "lubricant",
    PortKind.FORCE,
    "guide",
    about="position; viscous friction on the carriage along it; load that friction itself",
    displacement=1e-3,
    velocity=0.1,
    force=20.0,
    damped_at=0.1,
)
SCREW = Port(
    "screw",
    PortKind.FORCE,
    "screw",
    about="position; force on the carriage along it",
    displacement=0.1,
    velocity=0.1,
    force=10.0,
)
DRIVE = Port("drive", PortKind.INPUT, "drive", displacement_unit="N", displacement=5.0)
NUMBERS = Port("inertia", PortKind.NUMBER, "carriage", numbers=(Number("mass", "kg", 5.0),))
ENCODER = Port("encoder", PortKind.SENSOR, "sensor.position", displacement=1e-5)

PARAMETERS = ParameterTable(
    (
        Parameter("mass", 100.0, "kg", lower=1e-4, upper=1e8, about="mass that the motor feels"),
        Parameter("viscous_friction", 100.0, "N s/m", lower=0.0, upper=1e9, about="viscous friction"),
        Parameter("holding", 0.0, "N/m", lower=0.0, about="stiffness of the position loop"),
        Parameter(
            "k_pre",
            1e6,
            "N/m",
            tolerance=2e6,
            lower=0.0,
            about="stiffness of the guide before it slides",
            source=TYPICAL,
        ),
        Parameter(
            "c_pre", 3e3, "N s/m", lower=0.0, about="damping of the guide before it slides", source=TYPICAL
        ),
        Parameter("g", 9.80665, "m/s^2", about="acceleration of free fall"),
    )
)
"""Round numbers for such an axis; what a recording identifies is estimated."""


class Axis(AbstractPlant):
    """The axis, plus the effects that were added to it."""

    coordinates: ClassVar[tuple[Coordinate, ...]] = (
        Coordinate("x", "m", "position of the carriage", 1e-2, 1e-1, 1.0),
    )
    coordinate_type: ClassVar[type[Position]] = Position
    inputs: ClassVar[tuple[Input, ...]] = (Input("drive_force", "N", "drive force", moves=(1e-4,)),)
    channels: ClassVar[tuple[Channel, ...]] = (Channel("position", "m", "position", decay=2),)
    ports: ClassVar[tuple[Port, ...]] = (GUIDE, LUBRICANT, SCREW, DRIVE, NUMBERS, ENCODER)
    parameters: ClassVar[ParameterTable] = PARAMETERS

    def evaluate(
        self, p: Values, motion: Motion, u: Inputs, acting: EffectsAtInstant, prepared: None = None
    ) -> tuple[Float[Array, "1"], Loads]:
        """Force on the carriage out of balance [N], and what it is made of."""
        x, xd, xdd = motion.q.x, motion.qd.x, motion.qdd.x
        none = jnp.zeros_like(x)
        drive = acting.input(DRIVE, u.signals[0], u.fundamental).value - p["holding"] * x
        sliding = PortSignals(x, xd, p["mass"] * p["g"] * jnp.ones_like(x), none)
        viscous = -p["viscous_friction"] * xd
        lubricant = viscous + acting.force(LUBRICANT, PortSignals(x, xd, viscous, none))
        acting.report(LUBRICANT, lubricant)
        guide = acting.force(GUIDE, sliding) + lubricant
        screw = acting.force(SCREW, PortSignals(x, xd, none, none))
        return jnp.stack([drive + guide + screw - p["mass"] * xdd]), Loads(drive, guide, screw)

    def read(
        self, p: Values, motion: Motion, s: Array, sd: Array, u: Inputs, prepared: None = None
    ) -> Readings:
        """The position."""
        return Readings(motion.q.x)
