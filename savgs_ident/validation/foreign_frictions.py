"""Friction by other formulas than the catalogue's.

Each law has a bristle or a reversal of its own and counts as a share beside what the port has. Internal states are
those of unit friction, so that the laws are regular where the friction vanishes. Bristles creep back by a hundredth a
second: a rig at rest has one state then.

They are the truth of foreign trials (:mod:`savgs_ident.validation.foreign_laws`): no diagnosis knows them.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    CREEP,
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    Family,
    FrictionLimit,
    InternalState,
    Port,
    PortSignals,
    Role,
)

Scalar = Float[Array, ""]
State = Float[Array, " s"]


def friction_force(port: Port) -> Parameter:
    """A friction of the port's typical force [its unit], at most a thousand times it."""
    return Parameter(
        "force", port.force, port.force_unit, lower=0.0, upper=1e3 * port.force, about="friction force"
    )


def reversal_velocity(port: Port, share: float) -> Parameter:
    """A velocity at which friction turns round, as a ``share`` of the port's typical one [1]."""
    value, unit = share * port.velocity, f"{port.displacement_unit}/s"
    return Parameter(
        "velocity", value, unit, lower=value / 10.0, upper=10.0 * value, about="velocity of reversal"
    )


def _stretch(port: Port, share: float) -> Parameter:
    """How far a bristle gives before it slides, as a ``share`` of the port's typical displacement [1]."""
    value, unit = share * port.displacement, port.displacement_unit
    return Parameter(
        "stretch", value, unit, lower=value / 10.0, upper=10.0 * value, about="travel before sliding"
    )


def _bristle_state() -> tuple[InternalState, ...]:
    """The share of the friction force that a bristle holds."""
    return (InternalState("bristle", "1", 1.0, slips=True),)


class ExponentialStribeck(AbstractFrictionLimitLaw):
    """More friction at low speed, falling off with the exponential of the speed.

        mu(v) = mu (1 + s exp(-|v| / v_s))

    with the velocity v [m/s], the coefficient mu [1] of fast sliding, the rise s [1] over it and the Stribeck
    velocity v_s [m/s]. The law is the share above the friction of fast sliding.

    Source: Tustin 1947, Journal of the Institution of Electrical Engineers 94(2A).
    """

    name: ClassVar[str] = "exponential_stribeck"
    roles: ClassVar[tuple[Role, ...]] = (Role("coefficient"), Role("rise", 0.0), Role("velocity"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A tenth of a coefficient of three hundredths, at a quarter of the typical velocity."""
        return {
            "coefficient": 0.03,
            "rise": Parameter("rise", 0.1, "1", lower=0.0, upper=20.0, about="rise of friction at rest"),
            "velocity": reversal_velocity(port, 0.25),
        }

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """The share above the friction of fast sliding [N]."""
        rise = v["rise"] * jnp.exp(-jnp.abs(signals.velocity) / v["velocity"])
        share = v["coefficient"] * rise * signals.load
        return FrictionLimit(share, share)


class Dahl(AbstractForceLaw):
    """Friction whose bristle gives the more easily the nearer it is to sliding.

        F = -F_c z,        zd = (v - |v| z) / x_s

    with the velocity v [m/s], the friction F_c [N], the share z [1] of it that the bristle holds and the travel x_s
    [m] before sliding.

    Source: Dahl 1968, A Solid Friction Model, The Aerospace Corporation TOR-0158(3107-18).
    """

    name: ClassVar[str] = "dahl"
    family: ClassVar[Family] = Family.FRICTION
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("stretch"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force, which slides after a twentieth of the typical displacement."""
        return {"force": friction_force(port), "stretch": _stretch(port, 0.05)}

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The share of the friction that the bristle holds."""
        return _bristle_state()

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The friction [N]."""
        return -v["force"] * state[0]

    def rate(self, v: Values, signals: PortSignals, state: State) -> State:
        """Rate of the bristle [1/s]."""
        speed = signals.velocity
        return (speed - jnp.abs(speed) * state) / v["stretch"] - CREEP * state


class LuGre(AbstractForceLaw):
    """Friction of a bristle with damping of its own, and a Stribeck effect.

        F = -F_c (z + T zd),        zd = (v - |v| z / g(v)) / x_s,        g(v) = 1 + s exp(-(v / v_s)^2)

    with the velocity v [m/s], the friction F_c [N] of fast sliding, the bristle z [1], its travel x_s [m] and damping
    over stiffness T [s], the rise s [1] at rest and the Stribeck velocity v_s [m/s].

    Source: Canudas de Wit, Olsson, Astrom, Lischinsky 1995, IEEE Transactions on Automatic Control 40(3).
    """

    name: ClassVar[str] = "lugre"
    family: ClassVar[Family] = Family.FRICTION
    roles: ClassVar[tuple[Role, ...]] = (
        Role("force", 0.0),
        Role("stretch"),
        Role("lag"),
        Role("rise"),
        Role("velocity"),
    )

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force, half as much again at rest; it slides after a twentieth of the typical displacement."""
        return {
            "force": friction_force(port),
            "stretch": _stretch(port, 0.05),
            "lag": 5e-4,
            "rise": Parameter("rise", 0.5, "1", lower=0.0, upper=2.0, about="rise of friction at rest"),
            "velocity": reversal_velocity(port, 0.2),
        }

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The bristle, of unit friction."""
        return _bristle_state()

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The friction [N]."""
        return -v["force"] * (state[0] + v["lag"] * self.rate(v, signals, state)[0])

    def rate(self, v: Values, signals: PortSignals, state: State) -> State:
        """Rate of the bristle [1/s]."""
        speed = signals.velocity
        level = 1.0 + v["rise"] * jnp.exp(-((speed / v["velocity"]) ** 2))
        return (speed - jnp.abs(speed) * state / level) / v["stretch"] - CREEP * state


class BoucWen(AbstractForceLaw):
    """Hysteresis that rounds off on the way to its limit and returns more steeply.

        F = -F_c z,        zd = (v - beta |v| |z| z - (1 - beta) v z^2) / x_s

    with the velocity v [m/s], the limit F_c [N], the hysteretic variable z [1], the travel x_s [m] to the limit and
    beta [1] between a half and one.

    Source: Wen 1976, Journal of the Engineering Mechanics Division 102(2), with an exponent of two.
    """

    name: ClassVar[str] = "bouc_wen"
    family: ClassVar[Family] = Family.FRICTION
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("stretch"), Role("beta"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force, reached after about a tenth of the typical displacement."""
        return {"force": friction_force(port), "stretch": _stretch(port, 0.1), "beta": 0.7}

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The hysteretic variable."""
        return _bristle_state()

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The hysteretic force [N]."""
        return -v["force"] * state[0]

    def rate(self, v: Values, signals: PortSignals, state: State) -> State:
        """Rate of the hysteretic variable [1/s]."""
        speed = signals.velocity
        along = v["beta"] * jnp.abs(speed) * jnp.abs(state) * state
        across = (1.0 - v["beta"]) * speed * state**2
        return (speed - along - across) / v["stretch"] - CREEP * state


class SmoothFriction(AbstractForceLaw):
    """Friction that turns round smoothly and never sticks.

        F = -F_c tanh(v / v_t)

    with the velocity v [m/s], the friction F_c [N] and the velocity v_t [m/s] of reversal.

    Source: Andersson, Soderberg, Bjorklund 2007, Tribology International 40(4).
    """

    name: ClassVar[str] = "smooth_friction"
    family: ClassVar[Family] = Family.FRICTION
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("velocity"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force, which turns round within a twentieth of the typical velocity."""
        return {"force": friction_force(port), "velocity": reversal_velocity(port, 0.05)}

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The friction [N]."""
        return -v["force"] * jnp.tanh(signals.velocity / v["velocity"])


class DirectionalFriction(AbstractForceLaw):
    """Friction that differs by direction and turns round smoothly.

        F = -F_c (t + a t^2),        t = tanh(v / v_t)

    with the velocity v [m/s], the mean F_c [N] of the friction up and down, the asymmetry a [1] within -1 .. 1 and
    the velocity v_t [m/s] of reversal.

    Source: Armstrong-Helouvry 1991, Control of Machines with Friction, for the directions; the reversal as in
    Andersson, Soderberg, Bjorklund 2007, Tribology International 40(4).
    """

    name: ClassVar[str] = "directional_friction"
    family: ClassVar[Family] = Family.FRICTION
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("asymmetry"), Role("velocity"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force, four fifths more up than on average and four fifths less down."""
        about = "friction up over the mean of up and down, less one"
        return {
            "force": friction_force(port),
            "asymmetry": Parameter("asymmetry", 0.8, "1", lower=-1.0, upper=1.0, about=about),
            "velocity": reversal_velocity(port, 0.1),
        }

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The friction [N]."""
        turn = jnp.tanh(signals.velocity / v["velocity"])
        return -v["force"] * (turn + v["asymmetry"] * turn**2)
