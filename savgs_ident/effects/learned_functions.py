"""The functions of learned laws: a row each, with its words, its family and the function itself.

The laws themselves, which are sums of them, are in :mod:`savgs_ident.effects.learned`. The number of a coefficient is
the place of its function in the rows of the port (:func:`functions_at`), so that rows are added at the end of a table
alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.effects.base import Family, Port, PortKind


class Function(NamedTuple):
    """A function of a learned law.

    Attributes:
        words: the function in words.
        family: the family to which it belongs.
        value: the function [1] of what is seen: a :class:`RelativeMotion`, a :class:`RelativeLoad`, a
            :class:`RelativeAngle` or s [rad/s].
        interaction: whether it is a product of the displacement and the velocity.
    """

    words: str
    family: Family
    value: Callable[[Any], Array]
    interaction: bool = False


SHARP, BLUNT = 0.01, 0.1
"""Velocities over which friction-like functions turn round, as shares of the largest [1]."""

TURN = 0.03
"""The same where it is estimated along: what it begins with [1]."""

FALLING = (0.05, 0.2)
"""Velocities over which a friction falls, as shares of the largest [1]."""

FALL = 0.1
"""The same where it is estimated along: what it begins with [1]."""

GAPS = (0.3, 0.55)
"""Where stops begin, as shares of the stroke [1]."""

SOFT_GAPS = (0.0, 0.4)
"""Where stops begin that are touched softly, as shares of the stroke [1]."""

GAP = 0.2
"""The same where it is estimated along: what it begins with [1]."""

STRETCHES = (0.01, 0.03, 0.07, 0.2)
"""How far a spring-slider gives before it slides, as shares of the port's typical displacement [1].

In a learned law they are multiplied by a number that is estimated along.
"""

LAG = 1e-3
"""Damping over stiffness of a spring-slider, which is estimated along: what it begins with [s]."""

SMALLEST = 1e-9
"""Least stroke [m], speed [m/s] and load [N] by which is divided."""


@dataclass(frozen=True)
class RelativeMotion:
    """What functions of a force port are made of, relative to its range [1], (...) each.

    Attributes:
        x: (displacement - middle)/stroke.
        d: displacement over the largest, which is the size of the middle and the stroke.
        v: velocity/speed.
        n: load/carried.
        turn: the width w of a reversal.
        gap: the displacement g at which a contact begins.
        fall: the velocity f over which a friction falls.
        held: what the spring-sliders carry, one for each of :data:`STRETCHES`, or for the first of them.
    """

    x: Float[Array, "*n"]
    d: Float[Array, "*n"]
    v: Float[Array, "*n"]
    n: Float[Array, "*n"]
    turn: Float[Array, ""] | float = TURN
    gap: Float[Array, ""] | float = GAP
    fall: Float[Array, ""] | float = FALL
    held: Sequence[Float[Array, "*n"]] = ()

    @cached_property
    def sharp(self) -> Float[Array, "*n"]:
        """A friction that turns round over the smallest velocity."""
        return jnp.tanh(self.v / SHARP)

    @cached_property
    def turned(self) -> Float[Array, "*n"]:
        """A friction that turns round over the width that is estimated along."""
        return jnp.tanh(self.v / self.turn)

    @cached_property
    def fallen(self) -> Float[Array, "*n"]:
        """A friction that sticks, and falls over the velocity that is estimated along."""
        return self.held[0] * jnp.exp(-jnp.abs(self.v) / self.fall)

    def beyond(self, gap: Float[Array, ""] | float, side: float) -> Float[Array, "*n"]:
        """How far a stop at a gap is compressed, at the upper ``side`` 1 or the lower one -1."""
        return jnp.maximum(side * self.x - gap, 0.0)


class RelativeLoad(NamedTuple):
    """The load n beyond that at rest, the whole one N, and that at rest, in units of the largest [1], (...) each."""

    n: Float[Array, "*n"]
    whole: Float[Array, "*n"]
    rest: Float[Array, "*n"]

    def clearance(self, steepness: float) -> Float[Array, "*n"]:
        """What a clearance gives that is crossed over a small load; nothing at rest."""
        return jnp.tanh(steepness * self.whole) - jnp.tanh(steepness * self.rest)


class RelativeAngle(NamedTuple):
    """The angle a of the fundamental [rad], and its speed w in units of the largest [1], (...) each."""

    angle: Float[Array, "*n"]
    speed: Float[Array, "*n"]


_SIDES = (("", 1.0), ("-", -1.0))


def _falling(width: float) -> Function:
    words = f"tanh(v/{SHARP:g}) exp(-(v/{width:g})^2)"
    return Function(words, Family.FRICTION, lambda m: m.sharp * jnp.exp(-((m.v / width) ** 2)))


def _loaded_falling(width: float) -> Function:
    words = f"n tanh(v/{SHARP:g}) exp(-|v|/{width:g})"
    return Function(words, Family.FRICTION, lambda m: m.n * m.sharp * jnp.exp(-jnp.abs(m.v) / width))


def _stop(gap: float, sign: str, side: float) -> Function:
    return Function(f"max({sign}x - {gap:g}, 0)", Family.STOP, lambda m: m.beyond(gap, side))


def _soft_stop(gap: float, sign: str, side: float) -> Function:
    return Function(f"max({sign}x - {gap:g}, 0)^2", Family.STOP, lambda m: m.beyond(gap, side) ** 2)


def _contact(sign: str, side: float) -> Function:
    return Function(f"max({sign}x - g, 0)", Family.STOP, lambda m: m.beyond(m.gap, side))


def _damped_contact(sign: str, side: float) -> Function:
    words = f"max({sign}x - g, 0) v"
    return Function(words, Family.STOP, lambda m: m.beyond(m.gap, side) * m.v, interaction=True)


def _slider(place: int) -> Function:
    words = f"a spring-slider that gives by {STRETCHES[place]:g} typical displacements"
    return Function(words, Family.FRICTION, lambda m: m.held[place])


def _wave(name: str, wave: Callable[[Array], Array], order: int) -> Function:
    return Function(f"{name}({order} a)", Family.SHAPE, lambda at: wave(order * at.angle))


def _lag(c: float) -> Function:
    return Function(f"1/(1 + s/{c:g}) - 1", Family.DYNAMICS, lambda s: 1.0 / (1.0 + s / c) - 1.0)


def _second_order_lag(c: float) -> Function:
    words = f"1/(1 + 1.4 s/{c:g} + (s/{c:g})^2) - 1"
    return Function(words, Family.DYNAMICS, lambda s: 1.0 / (1.0 + 1.4 * s / c + (s / c) ** 2) - 1.0)


OF_THE_MOTION = (
    Function(f"tanh(v/{SHARP:g})", Family.FRICTION, lambda m: m.sharp),
    Function(f"tanh(v/{BLUNT:g})", Family.FRICTION, lambda m: jnp.tanh(m.v / BLUNT)),
    Function("v", Family.DAMPING, lambda m: m.v),
    Function("v|v|", Family.DAMPING, lambda m: m.v * jnp.abs(m.v)),
    Function("v^2", Family.DAMPING, lambda m: m.v**2),
    Function("x", Family.STIFFNESS, lambda m: m.x),
    Function("x^2", Family.STIFFNESS, lambda m: m.x**2),
    Function("x^3", Family.STIFFNESS, lambda m: m.x**3),
    Function(f"x tanh(v/{SHARP:g})", Family.FRICTION, lambda m: m.x * m.sharp, interaction=True),
    Function("x v", Family.DAMPING, lambda m: m.x * m.v, interaction=True),
    Function("x^2 v", Family.DAMPING, lambda m: m.x**2 * m.v, interaction=True),
    *map(_falling, FALLING),
    Function("|v|", Family.DAMPING, lambda m: jnp.abs(m.v)),
    *(_stop(gap, *side) for gap in GAPS for side in _SIDES),
    Function("x^4", Family.STIFFNESS, lambda m: m.x**4),
    *(_soft_stop(gap, *side) for gap in SOFT_GAPS for side in _SIDES),
    Function("x^5", Family.STIFFNESS, lambda m: m.x**5),
    Function("x^9", Family.STIFFNESS, lambda m: m.x**9),
    Function("v/(v^2 + 0.01)^(1/4)", Family.DAMPING, lambda m: m.v / jnp.sqrt(jnp.sqrt(m.v**2 + 0.1**2))),
    Function("tanh(v/w)", Family.FRICTION, lambda m: m.turned),
    Function(f"tanh(v/{SHARP:g})^2", Family.FRICTION, lambda m: m.sharp**2),
    Function("tanh(v/w)^2", Family.FRICTION, lambda m: m.turned**2),
    Function("d^2", Family.STIFFNESS, lambda m: m.d**2),
    Function("d^3", Family.STIFFNESS, lambda m: m.d**3),
    Function("d^5", Family.STIFFNESS, lambda m: m.d**5),
    Function("v/(v^2 + 0.0001)^(1/4)", Family.DAMPING, lambda m: m.v / jnp.sqrt(jnp.sqrt(m.v**2 + 0.01**2))),
)
"""Functions of a :class:`RelativeMotion` without a past, but for those of the load."""

OF_SLIDERS = tuple(map(_slider, range(len(STRETCHES))))
"""Functions of the displacement's past: what a spring carries before it slides."""

OF_THE_LOAD = (
    Function(f"n tanh(v/{SHARP:g})", Family.FRICTION, lambda m: m.n * m.sharp),
    Function("n v", Family.DAMPING, lambda m: m.n * m.v),
    Function("n", Family.DAMPING, lambda m: m.n),
    *map(_loaded_falling, FALLING),
)
"""Functions of a :class:`RelativeMotion` at a port with a load."""

OF_CONTACTS = (
    *(_damped_contact(*side) for side in _SIDES),
    *(_contact(*side) for side in _SIDES),
)
"""Functions of a :class:`RelativeMotion`: contacts, and what they take of the energy as they are pressed in."""

_FALLING_SLIDER = f"exp(-|v|/f) of a spring-slider that gives by {STRETCHES[0]:g} typical displacements"

OF_A_FALL = Function(_FALLING_SLIDER, Family.FRICTION, lambda m: m.fallen)
"""A friction of a :class:`RelativeMotion` that sticks and then falls with the velocity."""

OF_A_LOADED_FALL = Function(f"n {_FALLING_SLIDER}", Family.FRICTION, lambda m: m.n * m.fallen)
"""The same in proportion to a load."""

OF_A_CONTACT = Function(
    "friction of the contact, of any load", Family.FRICTION, lambda m: jnp.zeros_like(m.v)
)
"""What a contact holds before it slides, beside what it holds already: no force of a :class:`RelativeMotion`."""

OF_WHAT_GIVES = (
    Function("n", Family.COMPLIANCE, lambda load: load.n),
    Function("n|n|", Family.COMPLIANCE, lambda load: load.n * jnp.abs(load.n)),
    Function("n^2", Family.COMPLIANCE, lambda load: load.n**2),
    Function("n^3", Family.COMPLIANCE, lambda load: load.n**3),
    Function("tanh(50 N)", Family.PLAY, lambda load: load.clearance(50.0)),
    Function("tanh(5 N)", Family.PLAY, lambda load: load.clearance(5.0)),
)
"""Functions of a :class:`RelativeLoad` at a series port, nothing at rest."""

ORDERS = tuple(range(1, 10))
"""Orders of a learned input."""

OF_THE_ANGLE = (
    Function("cos(1 a)", Family.GAIN, lambda at: jnp.cos(at.angle)),
    Function("sin(1 a)", Family.DYNAMICS, lambda at: jnp.sin(at.angle)),
    *(
        _wave(name, wave, order)
        for order in ORDERS[1:]
        for name, wave in (("cos", jnp.cos), ("sin", jnp.sin))
    ),
    Function("w sin(a)", Family.DYNAMICS, lambda at: at.speed * jnp.sin(at.angle)),
    Function("w cos(a)", Family.DYNAMICS, lambda at: at.speed * jnp.cos(at.angle)),
)
"""Functions of a :class:`RelativeAngle` at an input."""

CORNERS = (2.0, 6.0, 20.0, 60.0, 180.0)
"""Corner frequencies [rad/s] of the lags of first order of a learned transfer function."""

SECOND_CORNERS = (20.0, 60.0, 120.0, 240.0, 480.0)
"""Those of its lags of second order, which are damped by 0.7."""

RATE = 20.0
"""Angular frequency [rad/s] in units of which it has rates."""

OF_THE_FREQUENCY = (
    Function("1", Family.GAIN, jnp.ones_like),
    Function(f"s/{RATE:g}", Family.DYNAMICS, lambda s: s / RATE),
    Function(f"(s/{RATE:g})^2", Family.DYNAMICS, lambda s: (s / RATE) ** 2),
    *map(_lag, CORNERS),
    *map(_second_order_lag, SECOND_CORNERS),
)
"""Functions of s = j 2 pi f [rad/s] at a sensor."""


def values_of(functions: Sequence[Function], seen: object) -> list[Array]:
    """The values [1] of functions of what is ``seen``, in their order."""
    return [each.value(seen) for each in functions]


def what_gives(
    n: Float[Array, "*n"], whole: Float[Array, "*n"], rest: Float[Array, "*n"]
) -> list[Float[Array, "*n"]]:
    """The functions of a load beyond that at rest ``n``, of the whole and of that at rest [1]: nothing at rest."""
    return values_of(OF_WHAT_GIVES, RelativeLoad(n, whole, rest))


def filters(omega: Float[Array, "*f"]) -> list[Complex[Array, "*f"]]:
    """The functions of a sensor at angular frequencies [rad/s]."""
    return values_of(OF_THE_FREQUENCY, lax.complex(jnp.zeros_like(omega), omega))


def functions_at(port: Port) -> tuple[Function, ...]:
    """The functions of the learned law at a port; none where nothing is learned."""
    if port.kind is PortKind.FORCE:
        loads, falls = (OF_THE_LOAD, (OF_A_FALL, OF_A_LOADED_FALL)) if port.loaded else ((), (OF_A_FALL,))
        holds = (OF_A_CONTACT,) if port.contact else ()
        return (*OF_THE_MOTION, *OF_SLIDERS, *loads, *OF_CONTACTS, *falls, *holds)
    if port.kind is PortKind.SERIES:
        return () if port.resonant else OF_WHAT_GIVES
    return {PortKind.INPUT: OF_THE_ANGLE, PortKind.SENSOR: OF_THE_FREQUENCY}.get(port.kind, ())


def coefficients_at(port: Port) -> tuple[str, ...]:
    """Names of the coefficients at a port, one for each of its functions."""
    return tuple(f"learned_{port.name}_{number}" for number in range(1, len(functions_at(port)) + 1))


def coefficients_of(port: Port, family: Family) -> tuple[str, ...]:
    """Names of the coefficients of a family's functions at a port; dynamics have a gain, too."""
    mine = {family, Family.GAIN} if family is Family.DYNAMICS else {family}
    both = zip(coefficients_at(port), functions_at(port), strict=True)
    return tuple(name for name, function in both if function.family in mine)


def blocking_at(port: Port) -> str | None:
    """Name of the number by which a play is blocked at its ends; None where nothing gives way by a learned law."""
    return f"learned_{port.name}_blocking" if port.kind is PortKind.SERIES and not port.resonant else None


def placed_at(port: Port) -> dict[str, tuple[str, ...]]:
    """Numbers that say where functions at a port begin or end, by name, and the coefficients of these functions."""
    if port.kind is not PortKind.FORCE:
        return {}
    both = tuple(zip(coefficients_at(port), functions_at(port), strict=True))
    groups = {"gap": OF_CONTACTS, "fall": (OF_A_FALL, OF_A_LOADED_FALL)}
    return {
        f"learned_{port.name}_{number}": tuple(name for name, function in both if function in group)
        for number, group in groups.items()
    }


def alone_at(port: Port) -> tuple[tuple[str, ...], ...]:
    """Coefficients of functions at a port that could be all of a law, with the numbers that are estimated along.

    Contacts, a friction that falls, one that does not, and one that is the contact's.
    """
    if port.kind is not PortKind.FORCE:
        return ()
    both = zip(coefficients_at(port), functions_at(port), strict=True)
    single = tuple((name,) for name, function in both if function in (OF_SLIDERS[0], OF_A_CONTACT))
    return (*placed_at(port).values(), *single)


def interactions_at(port: Port) -> tuple[str, ...]:
    """Names of the coefficients of products of displacement and velocity at a port."""
    both = zip(coefficients_at(port), functions_at(port), strict=True)
    return tuple(name for name, function in both if function.interaction)


def frictions_at(port: Port) -> tuple[str, ...]:
    """Names of the coefficients of frictions at a port; with all at zero, what remains is smooth at rest."""
    return coefficients_of(port, Family.FRICTION)
