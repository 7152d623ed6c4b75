"""Springs, dampers, contacts and attached masses by other formulas than the catalogue's.

They are the truth of foreign trials (:mod:`savgs_ident.validation.foreign_laws`): no diagnosis knows them.
"""

from collections.abc import Mapping
from math import pi
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    SETTLING,
    AbstractForceLaw,
    AbstractSeriesLaw,
    Family,
    InternalState,
    Load,
    Port,
    PortSignals,
    Role,
    per,
)

Scalar = Float[Array, ""]
State = Float[Array, " s"]

STEEPEST = 20.0
"""Largest exponent of an exponential spring: beyond it the force is so large that it stays what it is."""


CENTRING = 1e-3
"""Stiffness within a play over that of its flanks [1]: a rig at rest has one state then."""


def _amplitude(role: str, value: float, unit: str, about: str, most: float = 1e4) -> Parameter:
    """A size that is never negative, at most ``most`` times the typical ``value`` [``unit``]."""
    return Parameter(role, value, unit, lower=0.0, upper=most * value, about=about)


def _shape(role: str, value: float, unit: str, about: str, within: float = 4.0) -> Parameter:
    """A number that shapes a law, a factor ``within`` to either side of its ``value`` [``unit``]."""
    return Parameter(role, value, unit, lower=value / within, upper=value * within, about=about)


def _deflection(signals: PortSignals, from_rest: bool) -> Scalar:
    """Deflection [m] of a spring: from the nominal state, or, without ``from_rest``, its compression alone."""
    if from_rest:
        return signals.displacement - signals.rest
    return jnp.maximum(signals.displacement, 0.0)


def _beyond(displacement: Array, gap: Scalar) -> Array:
    """What of a displacement lies beyond a gap to either side, both in one unit."""
    return displacement - jnp.clip(displacement, -gap, gap)


class CubicStiffness(AbstractForceLaw):
    """A spring that stiffens with the cube of its deflection.

        F = -k_3 x^3

    with the deflection x [m] and k_3 [N/m^3]. The deflection counts from the nominal state or, for a tyre, is its
    compression.

    Source: Duffing 1918, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz.
    """

    name: ClassVar[str] = "cubic_stiffness"
    family: ClassVar[Family] = Family.STIFFNESS
    roles: ClassVar[tuple[Role, ...]] = (Role("stiffness", 0.0),)
    from_rest: bool = eqx.field(static=True, default=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force at the typical displacement."""
        unit = per(port.force_unit, f"{port.displacement_unit}^3")
        size = port.force / port.displacement**3
        return {"stiffness": _amplitude("stiffness", size, unit, "cubic stiffness")}

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The force on top of that of the linear spring [N]."""
        return -v["stiffness"] * _deflection(signals, self.from_rest) ** 3


class ExponentialStiffness(AbstractForceLaw):
    """A spring that stiffens exponentially.

        F = -F_0 sign(x) (exp(|x| / d) - 1)

    with the deflection x [m], the force F_0 [N] and the deflection d [m] over which the stiffness grows e-fold. x
    counts from the nominal state or, for a tyre, is its compression.

    Source: Fung 1967, American Journal of Physiology 213(6), on the elasticity of soft materials.
    """

    name: ClassVar[str] = "exponential_stiffness"
    family: ClassVar[Family] = Family.STIFFNESS
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("growth"))
    from_rest: bool = eqx.field(static=True, default=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A tenth of the typical force; it grows e-fold over half the typical displacement."""
        about = "deflection over which the stiffness grows e-fold"
        return {
            "force": _amplitude("force", port.force / 10.0, port.force_unit, "force of the spring"),
            "growth": _shape("growth", 0.5 * port.displacement, port.displacement_unit, about),
        }

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The force on top of that of the linear spring [N]."""
        deflection = _deflection(signals, self.from_rest)
        grown = jnp.expm1(jnp.minimum(jnp.abs(deflection) / v["growth"], STEEPEST))
        return -v["force"] * jnp.sign(deflection) * grown


class ExponentialStop(AbstractForceLaw):
    """A progressive buffer at the lower end of the travel: touched softly, then steeper and steeper.

        F = F_0 (exp(c / d) - 1),        c = max(0, x_0 - x)

    with the displacement x [m], x_0 in the nominal state, where the buffer is just touched, the force F_0 [N] and the
    compression d [m] over which it grows e-fold.

    Source: Dixon 2009, Suspension Geometry and Computation, on bump rubbers.
    """

    name: ClassVar[str] = "exponential_stop"
    family: ClassVar[Family] = Family.STOP
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("growth"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A tenth of the typical force; it grows e-fold over a third of the typical displacement."""
        about = "compression over which the buffer grows e-fold"
        return {
            "force": _amplitude("force", port.force / 10.0, port.force_unit, "force of the buffer"),
            "growth": _shape("growth", port.displacement / 3.0, port.displacement_unit, about),
        }

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The buffer's push [N]."""
        compression = jnp.maximum(signals.rest - signals.displacement, 0.0)
        return v["force"] * jnp.expm1(jnp.minimum(compression / v["growth"], STEEPEST))


class QuadraticDrag(AbstractForceLaw):
    """Drag of a turbulent flow.

        F = -c v |v|

    with the velocity v [m/s] and c [N s^2/m^2].

    Source: Hoerner 1965, Fluid-Dynamic Drag.
    """

    name: ClassVar[str] = "quadratic_drag"
    family: ClassVar[Family] = Family.DAMPING
    roles: ClassVar[tuple[Role, ...]] = (Role("drag", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force at the typical velocity."""
        unit = per(f"{port.force_unit} s^2", f"{port.displacement_unit}^2")
        return {"drag": _amplitude("drag", port.force / port.velocity**2, unit, "coefficient of the drag")}

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The drag [N]."""
        return -v["drag"] * signals.velocity * jnp.abs(signals.velocity)


class DigressiveDamping(AbstractForceLaw):
    """A damper that gives the less the faster it moves.

        F = -F_1 (v / v_1) ((v^2 + v_0^2) / v_1^2)^((p - 1) / 2)

    with the velocity v [m/s], the force F_1 [N] at the velocity v_1 [m/s] and the exponent p [1] below one; below v_0
    [m/s] it is linear.

    Source: Dixon 2007, The Shock Absorber Handbook, on digressive valves.
    """

    name: ClassVar[str] = "digressive_damping"
    family: ClassVar[Family] = Family.DAMPING
    roles: ClassVar[tuple[Role, ...]] = (
        Role("force", 0.0),
        Role("exponent"),
        Role("velocity"),
        Role("linear_below"),
    )

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force at the typical velocity, in proportion to about its root."""
        return {
            "force": _amplitude("force", port.force, port.force_unit, "force at the typical velocity"),
            "exponent": Parameter("exponent", 0.55, "1", lower=0.4, upper=0.75, about="exponent of velocity"),
            "velocity": port.velocity,
            "linear_below": 0.03 * port.velocity,
        }

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The damper's force [N]."""
        ratio, least = signals.velocity / v["velocity"], v["linear_below"] / v["velocity"]
        return -v["force"] * ratio * (ratio**2 + least**2) ** ((v["exponent"] - 1.0) / 2.0)


class Clearance(AbstractForceLaw):
    """A clearance to either side, closed by a contact that takes energy.

        F = -sign(c) max(0, k |c| (1 + chi cd)),        c = x - x_0 beyond -g .. g

    with the displacement x [m], x_0 in the nominal state, the clearance g [m], the contact's compression c [m] and
    closing velocity cd [m/s], its stiffness k [N/m] and dissipation chi [s/m].

    Source: Hunt and Crossley 1975, Journal of Applied Mechanics 42(2), with a linear spring.
    """

    name: ClassVar[str] = "clearance"
    family: ClassVar[Family] = Family.STOP
    roles: ClassVar[tuple[Role, ...]] = (Role("stiffness", 0.0), Role("gap"), Role("dissipation"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A contact after three tenths of the typical displacement, with the typical force after a tenth more."""
        stiffness, unit = 10.0 * port.force / port.displacement, per(port.force_unit, port.displacement_unit)
        about = "clearance to either side"
        return {
            "stiffness": _amplitude("stiffness", stiffness, unit, "stiffness of the contact"),
            "gap": _shape("gap", 0.3 * port.displacement, port.displacement_unit, about),
            "dissipation": 0.5 / port.velocity,
        }

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The contact's push [N]."""
        pressed = _beyond(signals.displacement - signals.rest, v["gap"])
        closing = jnp.sign(pressed) * signals.velocity
        push = jnp.abs(pressed) * jnp.maximum(1.0 + v["dissipation"] * closing, 0.0)
        return -v["stiffness"] * jnp.sign(pressed) * push


class EndPlay(AbstractSeriesLaw):
    """Play in the path of a load between two damped, elastic flanks.

        tau xd + e x + (x beyond -g/2 .. g/2) = r g (F - F_0) / F_1

    with the displacement x [m], the play g [m], the load F [N], F_0 at rest, the load F_1 [N] that presses a flank in
    by the share r [1] of the play and the time tau [s] in which the film between the flanks gives way. A small e [1]
    centres what nothing presses.

    Source: Nordin, Galic, Gutman 1997, International Journal of Adaptive Control and Signal Processing 11(1), the
    physical model of backlash with a damped shaft.
    """

    name: ClassVar[str] = "end_play"
    family: ClassVar[Family] = Family.PLAY
    roles: ClassVar[tuple[Role, ...]] = (Role("play", 0.0), Role("load"), Role("share"), Role("time"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A tenth of the typical displacement between flanks that the typical load presses in by a tenth of it."""
        about = "play between the flanks"
        return {
            "play": _amplitude("play", 0.1 * port.displacement, port.displacement_unit, about, 100.0),
            "load": port.force,
            "share": 0.1,
            "time": 2e-4,
        }

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The displacement between the flanks."""
        return (InternalState("play", port.displacement_unit, port.displacement),)

    def balance(self, v: Values, load: Load, state: State, rate: State) -> State:
        """The displacement out of balance [m]."""
        pressed = v["share"] * v["play"] * load.beyond_rest / v["load"]
        there = CENTRING * state + _beyond(state, v["play"] / 2.0)
        return (v["time"] + SETTLING) * rate + there - pressed


def _attached_mass(port: Port) -> dict[str, Parameter | float]:
    """A mass with the typical force at a hundredth of gravity, on a mount of 8 Hz."""
    mass = port.force / 10.0
    about = "natural frequency of what is attached"
    return {
        "mass": _amplitude("mass", mass, "kg", "mass that is attached", 100.0),
        "frequency": _shape("frequency", 8.0, "Hz", about, 2.5),
        "damping_ratio": _shape("damping_ratio", 0.05, "1", "its damping ratio"),
    }


def _attached_states(port: Port) -> tuple[InternalState, ...]:
    """Displacement of the attached mass, in space, and its velocity."""
    unit = port.displacement_unit
    return (
        InternalState("attached_displacement", unit, port.displacement),
        InternalState("attached_velocity", f"{unit}/s", port.velocity),
    )


class HardeningOscillator(AbstractForceLaw):
    """A mass on rubber mounts that are stiffer the further they are deflected.

        F = -m ydd,        ydd = w^2 d (1 + (d / d_0)^2) + 2 zeta w (v - yd),        d = x - y,        w = 2 pi f

    with the port's displacement x [m] from the nominal state and velocity v [m/s], the mass's displacement y [m], its
    mass m [kg], natural frequency f [Hz] in small motions, damping ratio zeta [1] and the deflection d_0 [m] at
    which the mounts are twice as stiff.

    Source: Nayfeh and Mook 1979, Nonlinear Oscillations, ch. 6.
    """

    name: ClassVar[str] = "hardening_oscillator"
    family: ClassVar[Family] = Family.OSCILLATOR
    roles: ClassVar[tuple[Role, ...]] = (
        Role("mass", 0.0),
        Role("frequency"),
        Role("damping_ratio"),
        Role("deflection"),
    )

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A small mass on mounts of 9 Hz that are twice as stiff at one and a half times the typical displacement.

        So much damping that there is one motion, not two.
        """
        frequency = _shape("frequency", 9.0, "Hz", "natural frequency in small motions", 1.5)
        shapes: dict[str, Parameter | float]
        shapes = {"frequency": frequency, "damping_ratio": 0.15, "deflection": 1.5 * port.displacement}
        return _attached_mass(port) | shapes

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """Displacement and velocity of the mass."""
        return _attached_states(port)

    def force(self, v: Values, signals: PortSignals, state: State) -> Scalar:
        """The force of the mounts on the port [N]."""
        return -v["mass"] * self.rate(v, signals, state)[1]

    def rate(self, v: Values, signals: PortSignals, state: State) -> State:
        """Velocity [m/s] and acceleration [m/s^2] of the mass."""
        omega = 2.0 * pi * v["frequency"]
        deflection = signals.displacement - signals.rest - state[0]
        hard = 1.0 + (deflection / v["deflection"]) ** 2
        drag = 2.0 * v["damping_ratio"] * omega * (signals.velocity - state[1])
        return jnp.stack([state[1], omega**2 * deflection * hard + drag])
