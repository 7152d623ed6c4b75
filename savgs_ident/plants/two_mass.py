"""The linear quarter car of two masses: the smallest plant, and the reference of the tests that hold for all plants.

    m_s zdd_s =  k (z_u - z_s) + c (zd_u - zd_s) + f_s
    m_u zdd_u = -k (z_u - z_s) - c (zd_u - zd_s) - f_s + k_t (z_r - z_u) + c_t (zd_r - zd_u) + f_t

with the heights z_s, z_u of the sprung and the unsprung mass and z_r of the road, counted from rest. f_s and f_t are
what effects add at the ports. Without effects its responses are known in closed form (:func:`closed_form`).

Source: Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5.
"""

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Family, Number, Port, PortKind, PortSignals
from savgs_ident.effects.composition import EffectsAtInstant
from savgs_ident.plants.base import AbstractPlant, Channel, Coordinate, Input, Inputs, Motion, Scalar


class Heights(NamedTuple):
    """Heights of the sprung and the unsprung mass [m], or a time derivative of them."""

    z_s: Scalar
    z_u: Scalar


class Readings(NamedTuple):
    """Acceleration of the sprung mass [m/s^2] and suspension deflection [m]."""

    body_accel: Scalar
    susp_deflection: Scalar


class Loads(NamedTuple):
    """Forces [N]: what pushes the masses apart, the guide's on the sprung, the tyre's on the unsprung mass, up."""

    suspension: Scalar
    guide: Scalar
    tyre: Scalar


SUSPENSION = Port(
    "suspension",
    PortKind.FORCE,
    "suspension",
    about="suspension deflection, bump; force that pushes the masses together",
    displacement=1e-2,
    velocity=0.1,
    force=30.0,
    sense=1.0,
)
GUIDE = Port(
    "guide",
    PortKind.FORCE,
    "guide",
    about="height of the sprung mass; force on it, up; load its weight",
    displacement=1e-2,
    velocity=0.1,
    force=30.0,
    loaded=True,
    contact=("k_pre", "c_pre"),
)
TYRE = Port(
    "tyre",
    PortKind.FORCE,
    "tyre",
    about="height of the unsprung mass over the road; force on the mass, up",
    displacement=5e-3,
    velocity=0.1,
    force=100.0,
)
MOUNT = Port(
    "mount",
    PortKind.SERIES,
    "suspension",
    about="mount, shortening, under the push of spring and damper",
    displacement=1e-3,
    velocity=0.1,
    force=1e3,
)
ROAD = Port("road", PortKind.INPUT, "road", displacement=1e-4)
NUMBERS = (
    Port(
        "strut",
        PortKind.NUMBER,
        "suspension",
        numbers=(Number("k", "N/m", 3e3, Family.STIFFNESS), Number("c", "N s/m", 100.0, Family.DAMPING)),
    ),
    Port(
        "wheel",
        PortKind.NUMBER,
        "tyre",
        numbers=(Number("k_t", "N/m", 1.5e4, Family.STIFFNESS), Number("c_t", "N s/m", 30.0, Family.DAMPING)),
    ),
    Port(
        "inertia", PortKind.NUMBER, "inertia", numbers=(Number("m_s", "kg", 10.0), Number("m_u", "kg", 2.0))
    ),
)
SENSORS = (
    Port("accelerometer", PortKind.SENSOR, "sensor.body_accel", displacement_unit="m/s^2", displacement=1.0),
    Port("potentiometer", PortKind.SENSOR, "sensor.susp_deflection"),
)

PARAMETERS = ParameterTable(
    (
        Parameter("m_s", 320.0, "kg", tolerance=1.6, lower=1.0, about="sprung mass"),
        Parameter("m_u", 49.0, "kg", tolerance=0.5, lower=1.0, about="unsprung mass"),
        Parameter("k", 6e4, "N/m", lower=0.0, upper=1e6, about="stiffness of the suspension at the wheel"),
        Parameter("c", 2.1e3, "N s/m", lower=0.0, upper=1e5, about="damping of the suspension at the wheel"),
        Parameter("k_t", 2.75e5, "N/m", tolerance=5.5e3, lower=0.0, about="stiffness of the tyre"),
        Parameter("c_t", 300.0, "N s/m", tolerance=30.0, lower=0.0, about="damping of the tyre"),
        Parameter("k_pre", 2e6, "N/m", lower=1.0, about="stiffness of the guide before it slides"),
        Parameter("c_pre", 6e3, "N s/m", lower=0.0, about="damping of the guide before it slides"),
        Parameter("g", 9.80665, "m/s^2", about="acceleration of free fall"),
    )
)
"""The paper's quarter car, with its linear equivalent for a suspension."""


class TwoMass(AbstractPlant):
    """The linear quarter car, plus the effects that were added to it."""

    coordinates: ClassVar[tuple[Coordinate, ...]] = (
        Coordinate("z_s", "m", "height of the sprung mass", 1e-2, 1e-1, 1.0),
        Coordinate("z_u", "m", "height of the unsprung mass", 1e-2, 1e-1, 3.0),
    )
    coordinate_type: ClassVar[type[Heights]] = Heights
    inputs: ClassVar[tuple[Input, ...]] = (
        Input("road_height", "m", "road", moves=(1.0, 1.0), keeps_mean=False),
    )
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("body_accel", "m/s^2", "sprung-mass acceleration", decay=1),
        Channel("susp_deflection", "m", "suspension deflection", decay=2),
    )
    ports: ClassVar[tuple[Port, ...]] = (SUSPENSION, GUIDE, TYRE, MOUNT, ROAD, *NUMBERS, *SENSORS)
    parameters: ClassVar[ParameterTable] = PARAMETERS

    def cold_start(self, u: Inputs) -> tuple[Heights, Heights, list[Array]]:
        """Both masses carried along by the road."""
        height, rate = u.signals[0]
        states = [height if state.slips else jnp.zeros_like(height) for state in self.states]
        return Heights(height, height), Heights(rate, rate), states

    def evaluate(
        self, p: Values, motion: Motion, u: Inputs, acting: EffectsAtInstant, prepared: None = None
    ) -> tuple[Float[Array, "2"], Loads]:
        """Forces on both masses out of balance [N], and what they are made of."""
        q, qd, qdd = motion
        road = acting.input(ROAD, u.signals[0], u.fundamental)
        zero = jnp.zeros_like(q.z_s)
        deflection, rate = q.z_u - q.z_s, qd.z_u - qd.z_s
        mount = acting.deflection(MOUNT)
        push = p["k"] * (deflection - mount.displacement) + p["c"] * (rate - mount.velocity)
        acting.carry(MOUNT, push, zero)
        push = push - acting.force(SUSPENSION, PortSignals(deflection, rate, zero, zero))
        weight = p["m_s"] * p["g"] * jnp.ones_like(q.z_s)
        guide = acting.force(GUIDE, PortSignals(q.z_s, qd.z_s, weight, zero))
        height, speed = q.z_u - road.value, qd.z_u - road.rate
        tyre = -p["k_t"] * height - p["c_t"] * speed
        tyre = tyre + acting.force(TYRE, PortSignals(height, speed, zero, zero))
        sprung = push + guide - p["m_s"] * qdd.z_s
        unsprung = tyre - push - p["m_u"] * qdd.z_u
        return jnp.stack([sprung, unsprung]), Loads(push, guide, tyre)

    def read(
        self, p: Values, motion: Motion, s: Array, sd: Array, u: Inputs, prepared: None = None
    ) -> Readings:
        """Acceleration of the sprung mass and suspension deflection."""
        return Readings(motion.qdd.z_s, motion.q.z_u - motion.q.z_s)


def closed_form(p: Mapping[str, float], frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """First harmonics of both channels per metre of road [1/s^2], [1] at frequencies [Hz], (D, 2).

    Valid without effects. The reference that tests of solvers and of diagnoses compare with; no product code uses it.
    """
    w = 2j * np.pi * frequency
    strut, tyre = p["k"] + p["c"] * w, p["k_t"] + p["c_t"] * w
    sprung, unsprung = p["m_s"] * w**2 + strut, p["m_u"] * w**2 + strut + tyre
    z_u = tyre * sprung / (sprung * unsprung - strut**2)
    z_s = strut * z_u / sprung
    return np.stack([w**2 * z_s, z_u - z_s], axis=-1)
