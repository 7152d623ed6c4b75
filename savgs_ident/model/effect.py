"""What an effect is: one physical mechanism, acting at one port of the rig.

The rig without friction (SimQC) has ports where something more may act. An effect takes the signals of its
port and returns a force along the port's coordinate; it may carry internal states with their rates. SimTR is
literally SimQC plus two effects:

    SimTR = SimQC + rail_coulomb + tyre_friction

Every effect has a *null*: parameter values at which it vanishes and is differentiable. So it can be tested
for, at no more cost than a gradient, on a model that does not have it.
"""

from abc import abstractmethod
from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
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
    """What an effect sees at its port.

    ``displacement`` [m] and ``velocity`` [m/s] are the pair conjugate to the force that the effect returns;
    ``load`` [N] is what a friction at this port is proportional to:

    ============== ===================================== ============================ =====================
    port           displacement, velocity                positive force acts on       load
    ============== ===================================== ============================ =====================
    rail           sprung mass, up                       sprung mass, up              |F_Nt| + |F_Nb|
    strut          strut length, growing in extension    strut, pushing it apart      0
    suspension     suspension deflection l_s, bump       wheel, up, against the body  0
    tyre_radial    tyre compression                      wheel, away from the plate   0
    tyre_lateral   upright at the contact point, outward upright, outward             F_tz
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


class AbstractEffect(eqx.Module):
    """Base of all effects; each one is final and lives in its own file under ``effects``."""

    name: eqx.AbstractClassVar[str]
    port: eqx.AbstractClassVar[Port]
    parameters: eqx.AbstractClassVar[tuple[Parameter, ...]]
    null: eqx.AbstractClassVar[Mapping[str, float]]
    states: eqx.AbstractClassVar[tuple[InternalState, ...]]
    symptom: eqx.AbstractClassVar[str]
    reference: eqx.AbstractClassVar[str]

    @abstractmethod
    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The force [N] along the port's coordinate (sign: see :class:`PortSignals`)."""

    @abstractmethod
    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """Time derivatives of the internal states, shape (s,); empty for an effect without states."""
