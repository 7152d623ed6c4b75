"""What an effect is: one physical mechanism, acting at one port of the rig.

The rig without friction (SimQC) has ports where something more may act. An effect is one of a few kinds, each
with one law:

    AbstractForce          a force at its port, beside what is there           (a spring, a friction)
    AbstractGrip           what the rail's carriages hold before they slide    (Coulomb, Stribeck, preload)
    AbstractSeries         something that gives way in the path of a load      (a mount, a carcass, a frame)
    AbstractChange         a number of the rig that is another                 (a spring rate, a mass)
    AbstractRoadFault      a plate that does not do what its encoder says      (a cam of another shape)
    AbstractSensorFault    a sensor that does not show what is there           (a lag, a gain)

SimTR is literally SimQC plus two effects:

    SimTR = SimQC + rail_coulomb + tyre_friction

Every effect has a *null*: parameter values at which it vanishes and is differentiable. So it can be tested
for, at no more cost than a gradient, on a model that does not have it.
"""

from abc import abstractmethod
from collections.abc import Mapping
from enum import Enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values


class Port(Enum):
    """Where an effect can act; the value is the name in files and reports."""

    RAIL = "rail"
    STRUT = "strut"
    SUSPENSION = "suspension"
    TYRE_RADIAL = "tyre_radial"
    TYRE_LATERAL = "tyre_lateral"
    LINK = "link"
    ROAD = "road"
    FRAME = "frame"
    INERTIA = "inertia"
    SENSOR_SPRUNG_ACCEL = "sensor.sprung_accel"
    SENSOR_SUSP_DEFLECTION = "sensor.susp_deflection"


class PortSignals(NamedTuple):
    """What a force sees at its port.

    ``displacement`` [m] and ``velocity`` [m/s] are the pair conjugate to the force that the effect returns;
    ``load`` [N] is what the port carries and a friction there is proportional to:

    ============== ===================================== ============================ =====================
    port           displacement, velocity                positive force acts on       load
    ============== ===================================== ============================ =====================
    rail           sprung mass over the frame, up        sprung mass, up              |F_Nt| + |F_Nb|
    strut          strut length, growing in extension    strut, pushing it apart      the damper's push
    suspension     suspension deflection l_s, bump       wheel, up, against the body  0
    tyre_radial    tyre compression                      wheel, away from the plate   0
    tyre_lateral   upright over the patch, outward       upright, outward             F_tz
    ============== ===================================== ============================ =====================

    Force times velocity is power into the rig, but for ``tyre_radial``, where it is power out of it. The
    velocity is the rate of the displacement, but for ``tyre_lateral``: there it is that of the upright's
    material point, which the moving contact point leaves behind.
    """

    displacement: Float[Array, ""]
    velocity: Float[Array, ""]
    load: Float[Array, ""]


class InternalState(NamedTuple):
    """An internal state of an effect.

    ``scale`` is a typical size [``unit``], for tolerances. ``slips`` marks a state that follows a
    rate-independent law (the anchor of a friction bristle): periodic solutions integrate it by backward
    Euler, which is the exact play operator, and all others by the trapezoidal rule.
    """

    name: str
    unit: str
    scale: float
    slips: bool = False


class Cam(NamedTuple):
    """Angle [rad] and speed [rad/s] of the cam; the angle is 0 where the first order of its lift is highest."""

    angle: Float[Array, ""]
    speed: Float[Array, ""]


class AbstractEffect(eqx.Module):
    """Base of all effects; each one is final, of one of the kinds below, and lives in its own file.

    ``tried`` are values of its shapes [SI] at which a diagnosis looks for it, where multiples of the typical ones
    would leave some out: natural frequencies, say.
    """

    name: eqx.AbstractClassVar[str]
    port: eqx.AbstractClassVar[Port]
    parameters: eqx.AbstractClassVar[tuple[Parameter, ...]]
    null: eqx.AbstractClassVar[Mapping[str, float]]
    states: eqx.AbstractClassVar[tuple[InternalState, ...]]
    symptom: eqx.AbstractClassVar[str]
    reference: eqx.AbstractClassVar[str]
    tried: ClassVar[tuple[Mapping[str, float], ...]] = ()


class AbstractForce(AbstractEffect):
    """A force at ``rail``, ``strut``, ``suspension``, ``tyre_radial`` or ``tyre_lateral``."""

    @abstractmethod
    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The force [N] along the port's coordinate (sign: see :class:`PortSignals`)."""

    @abstractmethod
    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """Time derivatives of the internal states, shape (s,) [unit of each per second].

        Empty for an effect without states.
        """


class Grip(NamedTuple):
    """Friction [N] with which the carriages resist sliding up and sliding down, both positive."""

    against_up: Float[Array, ""]
    against_down: Float[Array, ""]


class AbstractGrip(AbstractEffect):
    """A share of what the rail's carriages hold before they slide.

    All grips load one bristle (:mod:`savgs_ident.model.bristle`), for there is one contact.
    """

    @abstractmethod
    def grip(self, p: Values, signals: PortSignals) -> Grip:
        """The share [N]; it may be negative, the sum of all is held at zero or above."""


class Load(NamedTuple):
    """A load, and what of it is there when the rig stands in its nominal state, as what it acts on was set up.

    Both are in [N], or [N m] at the link.
    """

    total: Float[Array, ""]
    rest: Float[Array, ""]

    @property
    def beyond_rest(self) -> Float[Array, ""]:
        """The load less that at rest [N or N m]."""
        return self.total - self.rest


class AbstractSeries(AbstractEffect):
    """Something that gives way in the path of a load: its first state is by how much [m or rad], counted from rest.

    =============== ============================ =============================================================
    port            gives way (positive)         under the load (positive)
    =============== ============================ =============================================================
    strut           mount, shortening            push of the whole strut [N]
    damper (strut)  spring at the damper's end   push of the damper [N], if ``in_damper``
    link            link, to greater angles      torque to greater angles [N m]
    road            plate, down                  F_tz [N]
    tyre_lateral    upright over the patch, out  force on the plate, outward [N]
    frame           plate and rail, up           force on the frame, up [N]
    =============== ============================ =============================================================
    """

    in_damper: eqx.AbstractClassVar[bool]

    @abstractmethod
    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """What vanishes for the right ``rate`` of the states, shape (s,) [unit of each state], growing with it."""


class AbstractChange(AbstractEffect):
    """A number of the rig that is another than the sheet's."""

    @abstractmethod
    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The parameters that it changes, by name, SI."""


class AbstractRoadFault(AbstractEffect):
    """A plate that does not do what its encoder says."""

    @abstractmethod
    def shift(self, p: Values, road: Road, cam: Cam) -> Road:
        """Height [m] and velocity [m/s] that come on top of the recorded ones."""


class AbstractSensorFault(AbstractEffect):
    """A sensor that does not show what is there; linear in what it measures."""

    @abstractmethod
    def transfer(self, p: Values, frequency: Float[Array, " f"]) -> Complex[Array, " f"]:
        """Reading over truth at frequencies [Hz]."""


SETTLING = 2e-5
"""Least time [s] in which a series element gives way: far shorter than any motion of the rig. It keeps the
element's law regular where its compliance vanishes."""


def linear_series(
    compliance: Float[Array, ""],
    damping: Float[Array, ""],
    load: Load,
    state: Float[Array, " 1"],
    rate: Float[Array, " 1"],
) -> Float[Array, " 1"]:
    """Balance of a spring [m/N or rad/(N m)] with a damper beside it [N s/m or N m s/rad], any compliance >= 0.

    x + T xd = C (load - load at rest) with T = C c, at least :data:`SETTLING`.
    """
    time = jnp.sqrt((compliance * damping) ** 2 + SETTLING**2)
    return time * rate + state - compliance * load.beyond_rest
