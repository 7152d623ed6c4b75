"""Control laws: from what the instruments show to the velocity that is asked of the link.

The H-infinity law runs the sampled controller on acceleration, deflection and z_lin, and divides its command by
alpha. Around it stand two guards that a rig needs and a linear design does not know. The link may not reach the ends
of its range, where alpha vanishes: near them it is asked to move outward ever slower. And an angle that jumps further
than the motor can turn it is not believed: from then on the link is asked to stand still.
"""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.control.alpha_map import AlphaMap
from savgs_ident.control.controller_file import DigitalController

Scalar = Float[Array, ""]

ENDS = (np.radians(20.0), np.radians(160.0))
"""Link angles [rad] that the guard keeps the link between."""

GUARD_RATE = 2.0 * np.pi * 3.0
"""How fast the guard lets the link approach an end, per angle that is left [1/s]."""

HOLD = 2.0 * np.pi * 10.0
"""Velocity that is asked for per missing angle where the link is to stand still [1/s]."""

HOLD_PER_RATE = 0.1
"""The most of it per rate of the law [1]: beyond about five times this its own delay makes it unstable."""

JUMP = 3.0
"""An angle that moves by more than this times what the motor can do in a sample is not believed."""


class AbstractLaw(eqx.Module):
    """A sampled law with a state of its own."""

    @abstractmethod
    def start(self) -> Float[Array, " c"]:
        """The state in which the law begins, in its own units."""

    @abstractmethod
    def command(
        self, state: Float[Array, " c"], readings: Float[Array, "3"], fastest: Scalar
    ) -> tuple[Float[Array, " c"], Scalar]:
        """The next state and the link velocity to ask for [rad/s].

        ``readings`` are acceleration [m/s^2], deflection [m] and link angle [rad]; ``fastest`` [rad] is the
        furthest that the motor turns the link in a sample.
        """

    def doubted(self, state: Float[Array, " c"]) -> Scalar:
        """1 once a reading was not believed [1]; a law without doubts never has any."""
        return jnp.zeros(())


class HoldLaw(AbstractLaw):
    """Passive: the link is kept at ``angle`` [rad]; ``stiffness`` [1/s] asks for velocity per angle."""

    angle: Scalar = eqx.field(converter=jnp.asarray)
    stiffness: Scalar = eqx.field(converter=jnp.asarray)

    def start(self) -> Float[Array, " 0"]:
        """Nothing."""
        return jnp.zeros(0)

    def command(
        self, state: Float[Array, " c"], readings: Float[Array, "3"], fastest: Scalar
    ) -> tuple[Float[Array, " c"], Scalar]:
        """In proportion to the angle that is missing."""
        return state, self.stiffness * (self.angle - readings[2])


class HinfLaw(AbstractLaw):
    """The H-infinity law between its guards.

    ``a`` (n, n), ``b`` (n, 3), ``c`` (1, n), ``d`` (1, 3) of the sampled controller; its state is followed by the
    last angle that was believed [rad], and by 1 once one was not.
    """

    a: Float[Array, "n n"]
    b: Float[Array, "n 3"]
    c: Float[Array, "1 n"]
    d: Float[Array, "1 3"]
    alpha: AlphaMap

    def start(self) -> Float[Array, " m"]:
        """At rest at the nominal angle, everything believed."""
        return jnp.concatenate([jnp.zeros(self.a.shape[0]), jnp.stack([self.alpha.nominal, jnp.zeros(())])])

    def command(
        self, state: Float[Array, " m"], readings: Float[Array, "3"], fastest: Scalar
    ) -> tuple[Float[Array, " m"], Scalar]:
        """The controller's command over alpha, as far as the guards allow it."""
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
        """1 once an angle was not believed [1]."""
        return state[-1]


def hold_law(angle: Scalar, rate: float) -> HoldLaw:
    """A law of ``rate`` [1/s] that keeps the link at ``angle`` [rad]: as stiff as it may be, slower at low rates."""
    return HoldLaw(angle, jnp.asarray(min(HOLD, HOLD_PER_RATE * rate)))


def hinf_law(controller: DigitalController) -> HinfLaw:
    """The law of a controller."""
    space = controller.space
    a, b, c, d = (jnp.asarray(each) for each in (space.A, space.B, space.C, space.D))
    return HinfLaw(a, b, c, d, controller.alpha)
