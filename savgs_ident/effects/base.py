"""Ports, what a law sees there, and the kinds of laws.

A plant without effects has ports where something more may act. An effect is a law at a port under a name, with a
parameter for every number that the law takes (:mod:`savgs_ident.effects.effect`):

    rail_stribeck = Stribeck at the rail, rise = stribeck_rise, velocity = stribeck_velocity, coefficient = mu_r

A law knows neither parameters by name nor plants: its numbers have *roles*. Every law has a *null*: values of some
roles at which it vanishes and is differentiable. So it can be tested for, at no more cost than a gradient, on a model
that does not have it. A port is of one of a few kinds, and so is a law:

    port      law                        what the law does
    force     AbstractForceLaw           adds a force, beside what the plant has there  (a spring, a damper)
    force     AbstractFrictionLimitLaw   adds to what a contact holds before it slides  (Coulomb, Stribeck)
    series    AbstractSeriesLaw          gives way in the path of a load                (a mount, a gear, a frame)
    number    AbstractNumberLaw          changes a number of the plant                  (a mass, a spring rate)
    input     AbstractInputLaw           adds to what a recorded input says             (a cam of another shape)
    sensor    AbstractSensorLaw          shows other than what is there                 (a gain, a lag)

A friction limit alone is no force: the sum of all limits at a contact loads one elasto-plastic bristle
(:func:`bristle`), which makes the contact stick before it slides. A bristle of stiffness k and damping c, those of
the presliding of the sheet, anchored at w, gives

    f = k x + c v held within -G_down .. G_up,      x = z - w,

opposing the motion, with limits of friction G in both directions; the anchor is dragged along so that the spring
stays within them (Dupont et al. 2002).
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values


class PortKind(Enum):
    """What can act at a port; the value is the name in files and reports."""

    FORCE = "force"
    SERIES = "series"
    NUMBER = "number"
    INPUT = "input"
    SENSOR = "sensor"


class Family(Enum):
    """What kind of thing a law is; several laws of a family say the same by other formulas."""

    FRICTION = "friction"
    DAMPING = "damping"
    STIFFNESS = "stiffness"
    STOP = "stop"
    COMPLIANCE = "compliance"
    PLAY = "play"
    OSCILLATOR = "oscillator"
    NUMBER = "number"
    GAIN = "gain"
    DYNAMICS = "dynamics"
    SHAPE = "shape"
    LEARNED = "learned"


class Number(NamedTuple):
    """A parameter of the plant that may be another than its sheet says.

    Attributes:
        name: of the parameter.
        unit: its own.
        change: a typical one [``unit``].
        of: the kind of law whose linear part the number is, as a spring's rate that of a stiffness; else a number.
    """

    name: str
    unit: str
    change: float
    of: Family = Family.NUMBER


class Inertia(NamedTuple):
    """A mass of the plant as a force.

    If it is greater than the sheet's, a force in proportion to its acceleration is missing at the port ``force``; its
    velocity is the sum of those at the ports ``velocity``.
    """

    force: str
    velocity: tuple[str, ...]


@dataclass(frozen=True)
class Port:
    """Where a law can act.

    Sizes are typical for a law that matters there, and generic laws take their own from them.

    Attributes:
        name: unique within a plant.
        kind: what can act there.
        location: its name in files and reports; several ports may share one, as the force along a strut and the
            mount in series with it.
        about: what displacement, force and load are, and which sign is positive.
        displacement_unit: of displacement, of an input's value, or of what gives way.
        force_unit: of the force, or of the load in which something gives way.
        displacement: a typical size [``displacement_unit``].
        velocity: a typical size [``displacement_unit``/s].
        force: a typical size [``force_unit``].
        sense: power into the plant per force and velocity of the port, 1 or -1.
        loaded: whether the port carries a load to which a friction there is proportional.
        damped_at: where that load is the force of a damper that the plant has there, the amplitude of a sine of the
            velocity [``displacement_unit``/s] to whose energy its coefficient refers; None where there is no damper.
        contact: names of the stiffness and damping with which a contact sticks before it slides; only there is a
            limit of friction, and all such limits load one bristle.
        numbers: parameters that may be others than the sheet's, at a number port.
        inertias: at a number port, the masses among the numbers as forces at other ports.
        resonant: whether what is in series there has a mass of its own: then it swings under its load.
        time_scale: that of its plant [1]: laws take their typical times times it, and their frequencies over it.
        motion: name of the force port whose motion a report draws where the port has none of its own; where it is
            empty, the force port at the same location or else the first of the plant.
    """

    name: str
    kind: PortKind
    location: str
    about: str = ""
    displacement_unit: str = "m"
    force_unit: str = "N"
    displacement: float = 1e-2
    velocity: float = 0.3
    force: float = 30.0
    sense: float = 1.0
    loaded: bool = False
    damped_at: float | None = None
    contact: tuple[str, str] | None = None
    numbers: tuple[Number, ...] = ()
    inertias: tuple[Inertia, ...] = ()
    resonant: bool = False
    motion: str = ""
    time_scale: float = 1.0


class PortSignals(NamedTuple):
    """What a force sees at its port, in the port's units.

    ``displacement`` and ``velocity`` are the pair conjugate to the force; ``load`` is what the port carries, zero
    where it carries nothing; ``rest`` is the displacement in the plant's nominal state.
    """

    displacement: Float[Array, ""]
    velocity: Float[Array, ""]
    load: Float[Array, ""]
    rest: Float[Array, ""]


class Load(NamedTuple):
    """A load in which something may give way, and what of it is there when the plant stands in its nominal state.

    What gives way was set up under the load at rest. Both are in the port's unit of force.
    """

    total: Float[Array, ""]
    rest: Float[Array, ""]

    @property
    def beyond_rest(self) -> Float[Array, ""]:
        """The load less that at rest [the port's unit of force]."""
        return self.total - self.rest


class FrictionLimit(NamedTuple):
    """Friction with which a contact resists sliding either way before it slides, both positive [N]."""

    against_up: Float[Array, ""]
    against_down: Float[Array, ""]


class InputSignal(NamedTuple):
    """An input: its value in the port's unit and its rate in that per second."""

    value: Float[Array, ""]
    rate: Float[Array, ""]


class Fundamental(NamedTuple):
    """Angle [rad] and speed [rad/s] of the fundamental of a periodic input; at 0 that is highest."""

    angle: Float[Array, ""]
    speed: Float[Array, ""]


class InternalState(NamedTuple):
    """An internal state of an effect.

    ``scale`` is a typical size [``unit``], for tolerances. ``slips`` marks a state that follows a
    rate-independent law (the anchor of a friction bristle): periodic solutions integrate it by backward
    Euler, which is the exact play operator, and all others by the trapezoidal rule. Both are numbers of a program
    where one state stands for those of several effects.
    """

    name: str
    unit: str
    scale: float | Float[Array, ""]
    slips: bool | Bool[Array, ""] = False


class Role(NamedTuple):
    """A number that a law takes; where all roles with a ``null`` are at it the law vanishes, the others shape it."""

    name: str
    null: float | None = None


class AbstractLaw(eqx.Module):
    """Base of all laws; each one is final, of one of the kinds below, and lives in its own file.

    ``words`` say what a plant with it has, for a reader who does not know its name; where there are none its family
    must do.
    """

    kind: eqx.AbstractClassVar[PortKind]
    name: eqx.AbstractClassVar[str]
    family: eqx.AbstractClassVar[Family]
    roles: eqx.AbstractClassVar[tuple[Role, ...]]
    words: ClassVar[str] = ""

    @abstractmethod
    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """By role, a parameter of a typical size at a port, or a number that stays as it is; SI."""

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """Its internal states at a port."""
        return ()

    def tried(self, port: Port) -> tuple[tuple[str, float], ...]:
        """Values [SI] of shaping roles at which a diagnosis looks for the law at a port.

        Where multiples of the typical ones would leave some out: natural frequencies, say.
        """
        return ()

    def suits(self, port: Port) -> bool:
        """Whether it can act at a port without more than the port declares."""
        return port.kind is self.kind


class AbstractForceLaw(AbstractLaw):
    """A force along the displacement of its port: force times velocity is power into the plant."""

    kind: ClassVar[PortKind] = PortKind.FORCE
    holds_states: ClassVar[bool] = False
    """Whether the motion alone holds the states, between :meth:`bounds_of_states`."""
    drags_anchors: ClassVar[bool] = False
    """Whether the states are anchors that a :func:`bristle` drags, as fast as the time scale of the port says."""

    @abstractmethod
    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The force [the port's unit], with numbers ``v`` by role, SI."""

    def rate(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """Time derivatives of the internal states, shape (s,) [unit of each per second]; none without states."""
        return jnp.zeros(0)

    def bounds_of_states(
        self, v: Values, signals: PortSignals
    ) -> tuple[Float[Array, "s *n"], Float[Array, "s *n"]]:
        """Bounds [unit of each], lower and upper, that a motion alone sets to states that are anchors of bristles.

        Of a law whose states do more than follow the motion there are none.
        """
        none = jnp.zeros((0, *jnp.shape(signals.displacement)))
        return none, none

    def loads_contact(self, port: Port) -> bool:
        """Whether it adds to what a contact at a port holds before it slides, too (:meth:`limit`)."""
        return False

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """What it adds there [N], as that of an :class:`AbstractFrictionLimitLaw`."""
        return FrictionLimit(jnp.zeros_like(signals.load), jnp.zeros_like(signals.load))


class AbstractFrictionLimitLaw(AbstractLaw):
    """A share of the friction that a contact holds before it slides.

    All of a contact load one bristle (:mod:`savgs_ident.effects.base`).
    """

    kind: ClassVar[PortKind] = PortKind.FORCE
    family: ClassVar[Family] = Family.FRICTION

    @abstractmethod
    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """The share [N]; it may be negative, the sum of all is held at zero or above."""

    def suits(self, port: Port) -> bool:
        """Only where something sticks."""
        return port.kind is self.kind and port.contact is not None


class AbstractSeriesLaw(AbstractLaw):
    """Something that gives way in the path of a load: its first state is by how much, counted from rest."""

    kind: ClassVar[PortKind] = PortKind.SERIES

    @abstractmethod
    def balance(
        self, v: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """What vanishes for the right ``rate`` of the states, shape (s,) [unit of each state], growing with it."""


class AbstractNumberLaw(AbstractLaw):
    """A number of the plant, in the role ``number``, that is another than the sheet's."""

    kind: ClassVar[PortKind] = PortKind.NUMBER
    family: ClassVar[Family] = Family.NUMBER

    @abstractmethod
    def changed(self, v: Values) -> Float[Array, ""]:
        """The number as it is [its unit]."""


class AbstractInputLaw(AbstractLaw):
    """An input that does not do what its recording says."""

    kind: ClassVar[PortKind] = PortKind.INPUT

    @abstractmethod
    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """What comes on top of the recorded value and rate, in their units."""


class AbstractSensorLaw(AbstractLaw):
    """A sensor that does not show what is there; linear in what it measures."""

    kind: ClassVar[PortKind] = PortKind.SENSOR

    @abstractmethod
    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""


SETTLING = 2e-5
"""Least time [s] in which a series element gives way: far shorter than any motion of the plant. It keeps the
element's law regular where its compliance vanishes."""


def per(unit: str, other: str) -> str:
    """One unit over another, as it is written: ``m/N``, ``rad/(N m)``."""
    return f"{unit}/({other})" if " " in other else f"{unit}/{other}"


DRAG_TIME = 2e-4
"""How fast the anchor follows an over-stretched bristle [s], on a time scale of 1: short beside the 4 ms of a
reversal, and without effect on the force, which is held meanwhile."""

CREEP = 1e-2
"""Creep of a stuck bristle [1/s], on a time scale of 1. Without it a rig that never slides has as many periodic
motions as places to stick; over the tenths of a second of a stick it moves the anchor by less than a hundredth of the
stretch.
"""


class Presliding(NamedTuple):
    """Stiffness [N/m] and damping [N s/m] of a contact that sticks."""

    stiffness: Float[Array, ""]
    damping: Float[Array, ""]


class Bristle(NamedTuple):
    """Force on what slides [N], along its displacement, and velocity of the anchor [m/s]."""

    force: Float[Array, ""]
    rate: Float[Array, ""]


def held_within(x: Float[Array, ""], lower: Float[Array, ""], upper: Float[Array, ""]) -> Float[Array, ""]:
    """``x`` held within lower..upper. ``jnp.clip`` halves the slope in limits of zero, at the null.

    All are in the same unit.
    """
    return jnp.where(x > upper, upper, jnp.where(x < lower, lower, x))


def _not_below_zero(x: Float[Array, ""]) -> Float[Array, ""]:
    """``jnp.maximum`` halves the slope at zero, at the null."""
    return jnp.where(x < 0.0, 0.0, x)


def bristle(
    stick: Presliding, signals: PortSignals, limit: FrictionLimit, anchor: Float[Array, ""]
) -> Bristle:
    """The bristle's force and how fast its ``anchor`` [m] is dragged on a time scale of 1."""
    up, down = _not_below_zero(limit.against_up), -_not_below_zero(limit.against_down)
    stretch = signals.displacement - anchor
    resisting = held_within(stick.stiffness * stretch + stick.damping * signals.velocity, down, up)
    over = stretch - held_within(stretch, down / stick.stiffness, up / stick.stiffness)
    return Bristle(-resisting, over / DRAG_TIME + CREEP * stretch)
