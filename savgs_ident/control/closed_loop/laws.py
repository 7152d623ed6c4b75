"""What is between the sensors and the drive: control laws, instruments, failures.

The H-infinity law runs the sampled controller on acceleration, deflection and z_lin, and divides its command by
alpha. Two guards, which a linear design does not know, protect the rig. The link must not reach the ends of its
range, where alpha vanishes: near them its outward velocity is limited. And an angle that changes faster than the
motor can turn is rejected: from then on the link is commanded to stand still.

:class:`Instruments` adds noise and quantisation to the measurements; a :class:`LoopFailure` makes a part of the loop
fail at an instant, for good.
"""

from abc import abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.control.design import DigitalController
from savgs_ident.control.linear_equivalent import AlphaMap

Scalar = Float[Array, ""]
ENDS = (np.radians(20.0), np.radians(160.0))
"""Range of link angles [rad] in which the guard keeps the link."""
GUARD_RATE = 2.0 * np.pi * 3.0
"""Largest velocity towards an end of the range per remaining angle [1/s]."""
HOLD = 2.0 * np.pi * 10.0
"""Commanded velocity per angle error of a link that is held [1/s]."""
HOLD_PER_RATE = 0.1
"""Largest :data:`HOLD` per rate of the law [1]; from about five times this on, the delay makes it unstable."""
JUMP = 3.0
"""An angle that changes by more than this times the motor's range in a sample is rejected [1]."""


class AbstractControlLaw(eqx.Module):
    """A sampled law with a state of its own."""

    @abstractmethod
    def start(self) -> Float[Array, " c"]:
        """The initial state of the law, in its own units."""

    @abstractmethod
    def command(
        self, state: Float[Array, " c"], readings: Float[Array, "3"], fastest: Scalar
    ) -> tuple[Float[Array, " c"], Scalar]:
        """The next state and the commanded link velocity [rad/s].

        ``readings`` are acceleration [m/s^2], deflection [m] and link angle [rad]; ``fastest`` [rad] is the
        largest rotation of the link by the motor in a sample.
        """

    def doubted(self, state: Float[Array, " c"]) -> Scalar:
        """1 once a reading was rejected, else 0 [1]; always 0 for a law that rejects none."""
        return jnp.zeros(())


class HoldLaw(AbstractControlLaw):
    """Passive: the link is kept at ``angle`` [rad]; ``stiffness`` [1/s] asks for velocity per angle."""

    angle: Scalar = eqx.field(converter=jnp.asarray)
    stiffness: Scalar = eqx.field(converter=jnp.asarray)

    def start(self) -> Float[Array, " 0"]:
        """No state."""
        return jnp.zeros(0)

    def command(
        self, state: Float[Array, " c"], readings: Float[Array, "3"], fastest: Scalar
    ) -> tuple[Float[Array, " c"], Scalar]:
        """In proportion to the angle error."""
        return state, self.stiffness * (self.angle - readings[2])


class HinfLaw(AbstractControlLaw):
    """The H-infinity law between its guards.

    ``a`` (n, n), ``b`` (n, 3), ``c`` (1, n), ``d`` (1, 3) of the sampled controller; its state is followed by the
    last accepted angle [rad], and by 1 once an angle was rejected.
    """

    a: Float[Array, "n n"]
    b: Float[Array, "n 3"]
    c: Float[Array, "1 n"]
    d: Float[Array, "1 3"]
    alpha: AlphaMap

    def start(self) -> Float[Array, " m"]:
        """At rest at the nominal angle, nothing rejected."""
        return jnp.concatenate([jnp.zeros(self.a.shape[0]), jnp.stack([self.alpha.nominal, jnp.zeros(())])])

    def command(
        self, state: Float[Array, " m"], readings: Float[Array, "3"], fastest: Scalar
    ) -> tuple[Float[Array, " m"], Scalar]:
        """The controller's command over alpha, limited by the guards."""
        inner, angle_before, doubted = state[:-2], state[-2], state[-1]
        jumps = jnp.abs(readings[2] - angle_before) > JUMP * fastest
        doubted = jnp.where(jumps, 1.0, doubted)
        angle = jnp.where(doubted > 0.0, angle_before, readings[2])
        within = jnp.clip(angle, *ENDS)
        seen = jnp.stack([readings[0], readings[1], self.alpha.position(angle)])
        lin_velocity = (self.c @ inner + self.d @ seen)[0]
        wanted = lin_velocity / self.alpha.alpha(within)
        guarded = jnp.clip(wanted, GUARD_RATE * (ENDS[0] - within), GUARD_RATE * (ENDS[1] - within))
        asked = jnp.where(doubted > 0.0, 0.0, guarded)
        after = self.a @ inner + self.b @ seen
        return jnp.concatenate([after, jnp.stack([angle, doubted])]), asked

    def doubted(self, state: Float[Array, " m"]) -> Scalar:
        """1 once an angle was rejected [1]."""
        return state[-1]


def hold_law(angle: Scalar, rate: float) -> HoldLaw:
    """A law of ``rate`` [1/s] that keeps the link at ``angle`` [rad]: as stiff as it may be, slower at low rates."""
    return HoldLaw(angle, jnp.asarray(min(HOLD, HOLD_PER_RATE * rate)))


def hinf_law(controller: DigitalController) -> HinfLaw:
    """The law of a controller."""
    space = controller.space
    a, b, c, d = (jnp.asarray(each) for each in (space.A, space.B, space.C, space.D))
    return HinfLaw(a, b, c, d, controller.alpha)


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
    """Neither noise nor quantisation."""
    return Instruments(jnp.zeros(3), jnp.zeros(3))


NOTHING = "none"


class LoopFailure(eqx.Module):
    """From ``time`` [s] on, torque and power of the drive are scaled by ``drive``, sensor readings by ``alive`` [1].

    ``alive`` (3,) [1]: accelerometer, potentiometer, link angle.
    """

    time: Float[Array, ""]
    drive: Float[Array, ""]
    alive: Float[Array, "3"]

    def drive_at(self, t: Float[Array, ""]) -> Float[Array, ""]:
        """Scale of the drive's torque and power at ``t`` [s]."""
        return jnp.where(t >= self.time, self.drive, 1.0)

    def shown(self, t: Float[Array, ""], readings: Float[Array, "3"]) -> Float[Array, "3"]:
        """The readings that arrive at ``t`` [s]."""
        return jnp.where(t >= self.time, self.alive * readings, readings)


class FailureKind(NamedTuple):
    """A kind of failure: its description and the remaining drive and sensors.

    ``drive`` is the remaining share of the torque, ``alive`` those of the three readings [1].
    """

    about: str
    drive: float
    alive: tuple[float, float, float]


KINDS: Mapping[str, FailureKind] = MappingProxyType(
    {
        NOTHING: FailureKind("nothing fails", 1.0, (1.0, 1.0, 1.0)),
        "actuator-off": FailureKind(
            "the drive loses its torque and the strut turns the link", 1e-4, (1.0, 1.0, 1.0)
        ),
        "actuator-weak": FailureKind("the drive keeps half of its torque and power", 0.5, (1.0, 1.0, 1.0)),
        "accelerometer": FailureKind("the accelerometer shows zero", 1.0, (0.0, 1.0, 1.0)),
        "potentiometer": FailureKind("the potentiometer shows zero", 1.0, (1.0, 0.0, 1.0)),
        "encoder": FailureKind("the link angle shows zero", 1.0, (1.0, 1.0, 0.0)),
    }
)
"""The kinds of failure by name."""


def make_failure(kind: str, time: float) -> LoopFailure:
    """The failure of a ``kind`` at ``time`` [s]; a kind that is not in :data:`KINDS` is a KeyError."""
    found = KINDS[kind]
    return LoopFailure(jnp.asarray(time), jnp.asarray(found.drive), jnp.asarray(found.alive))
