"""The functions of learned laws, in words, in numbers, and by family.

The laws themselves, which are sums of them, are in :mod:`savgs_ident.effects.learned`.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.effects.base import Family, Port, PortKind


class Function(NamedTuple):
    """A function of a learned law.

    Attributes:
        words: the function in words.
        family: the family to which it belongs.
        interaction: whether it is a product of the displacement and the velocity.
    """

    words: str
    family: Family
    interaction: bool = False


SHARP = (0.01, 0.1)
"""Velocities over which friction-like functions turn round, as shares of the largest [1]."""

TURN = 0.03
"""The same where it is estimated along: what it begins with [1]."""

FALLING = (0.05, 0.2)
"""Velocities over which a friction falls, as shares of the largest [1]."""

GAPS = (0.3, 0.55)
"""Where stops begin, as shares of the stroke [1]."""

SOFT_GAPS = (0.0, 0.4)
"""Where stops begin that are touched softly, as shares of the stroke [1]."""

STRETCHES = (0.01, 0.03, 0.07, 0.2)
"""How far a spring-slider gives before it slides, as shares of the port's typical displacement [1]."""

OF_THE_MOTION = (
    Function("tanh(v/0.01)", Family.FRICTION),
    Function("tanh(v/0.1)", Family.FRICTION),
    Function("v", Family.DAMPING),
    Function("v|v|", Family.DAMPING),
    Function("v^2", Family.DAMPING),
    Function("x", Family.STIFFNESS),
    Function("x^2", Family.STIFFNESS),
    Function("x^3", Family.STIFFNESS),
    Function("x tanh(v/0.01)", Family.FRICTION, interaction=True),
    Function("x v", Family.DAMPING, interaction=True),
    Function("x^2 v", Family.DAMPING, interaction=True),
    Function("tanh(v/0.01) exp(-(v/0.05)^2)", Family.FRICTION),
    Function("tanh(v/0.01) exp(-(v/0.2)^2)", Family.FRICTION),
    Function("|v|", Family.DAMPING),
    *(Function(f"max({side}x - {gap:g}, 0)", Family.STOP) for gap in GAPS for side in ("", "-")),
    Function("x^4", Family.STIFFNESS),
    *(Function(f"max({side}x - {gap:g}, 0)^2", Family.STOP) for gap in SOFT_GAPS for side in ("", "-")),
    Function("x^5", Family.STIFFNESS),
    Function("x^9", Family.STIFFNESS),
    Function("v/(v^2 + 0.01)^(1/4)", Family.DAMPING),
    Function("tanh(v/w)", Family.FRICTION),
    Function("tanh(v/0.01)^2", Family.FRICTION),
    Function("tanh(v/w)^2", Family.FRICTION),
    *(Function(f"d^{power}", Family.STIFFNESS) for power in (2, 3, 5)),
    Function("v/(v^2 + 0.0001)^(1/4)", Family.DAMPING),
)
"""Functions of x = (displacement - middle)/stroke, v = velocity/speed and d = displacement/(|middle| + stroke).

The width w of a reversal is estimated along.
"""

OF_SLIDERS = tuple(
    Function(f"a spring-slider that gives by {width:g} typical displacements", Family.FRICTION)
    for width in STRETCHES
)
"""Functions of the displacement's past: what a spring carries before it slides."""

OF_THE_LOAD = (
    Function("n tanh(v/0.01)", Family.FRICTION),
    Function("n v", Family.DAMPING),
    Function("n", Family.DAMPING),
    Function("n tanh(v/0.01) exp(-|v|/0.05)", Family.FRICTION),
    Function("n tanh(v/0.01) exp(-|v|/0.2)", Family.FRICTION),
)
"""Functions with n = load/carried, at a port with a load."""

OF_WHAT_GIVES = (
    Function("n", Family.COMPLIANCE),
    Function("n|n|", Family.COMPLIANCE),
    Function("n^2", Family.COMPLIANCE),
    Function("n^3", Family.COMPLIANCE),
    Function("tanh(50 N)", Family.PLAY),
    Function("tanh(5 N)", Family.PLAY),
)
"""Functions of the load n beyond that at rest and of the whole load N, in units of the largest, at a series port."""

ORDERS = tuple(range(1, 10))
"""Orders of a learned input."""

OF_THE_ANGLE = (
    *(
        Function(f"{wave}({order} a)", family)
        for order in ORDERS
        for wave, family in (
            ("cos", Family.GAIN if order == 1 else Family.SHAPE),
            ("sin", Family.DYNAMICS if order == 1 else Family.SHAPE),
        )
    ),
    Function("w sin(a)", Family.DYNAMICS),
    Function("w cos(a)", Family.DYNAMICS),
)
"""Functions of the angle a of the fundamental and of its speed w, in units of the largest, at an input."""

CORNERS = (2.0, 6.0, 20.0, 60.0, 180.0)
"""Corner frequencies [rad/s] of the lags of first order of a learned transfer function."""

SECOND_CORNERS = (20.0, 60.0, 120.0, 240.0, 480.0)
"""Those of its lags of second order, which are damped by 0.7."""

RATE = 20.0
"""Angular frequency [rad/s] in units of which it has rates."""

OF_THE_FREQUENCY = (
    Function("1", Family.GAIN),
    Function("s/20", Family.DYNAMICS),
    Function("(s/20)^2", Family.DYNAMICS),
    *(Function(f"1/(1 + s/{c:g}) - 1", Family.DYNAMICS) for c in CORNERS),
    *(Function(f"1/(1 + 1.4 s/{c:g} + (s/{c:g})^2) - 1", Family.DYNAMICS) for c in SECOND_CORNERS),
)
"""Functions of s = j 2 pi f [rad/s] at a sensor."""

SMALLEST = 1e-9
"""Least stroke [m], speed [m/s] and load [N] by which is divided."""


def functions(
    x: Float[Array, "*n"],
    d: Float[Array, "*n"],
    v: Float[Array, "*n"],
    n: Float[Array, "*n"],
    turn: Float[Array, ""] | float = TURN,
) -> list[Float[Array, "*n"]]:
    """The values of all functions [1] that have no past, those of the motion first, then those of the load.

    ``turn`` is the width w of a reversal.
    """
    sharp, blunt, turned = (jnp.tanh(v / width) for width in (*SHARP, turn))
    falling = [sharp * jnp.exp(-((v / width) ** 2)) for width in FALLING]
    smooth = [v, v * jnp.abs(v), v**2, x, x**2, x**3, x * sharp, x * v, x**2 * v]
    stops = [jnp.maximum(side * x - gap, 0.0) for gap in GAPS for side in (1.0, -1.0)]
    soft = [jnp.maximum(side * x - gap, 0.0) ** 2 for gap in SOFT_GAPS for side in (1.0, -1.0)]
    directed = [turned, sharp**2, turned**2]
    late, early = (v / (v**2 + width**2) ** 0.25 for width in (0.1, 0.01))
    further = [x**4, *soft, x**5, x**9, late, *directed, d**2, d**3, d**5, early]
    loaded = [n * sharp, n * v, n, *(n * sharp * jnp.exp(-jnp.abs(v) / width) for width in FALLING)]
    return [sharp, blunt, *smooth, *falling, jnp.abs(v), *stops, *further, *loaded]


def what_gives(
    n: Float[Array, "*n"], whole: Float[Array, "*n"], rest: Float[Array, "*n"]
) -> list[Float[Array, "*n"]]:
    """The functions of a load beyond that at rest ``n``, of the whole and of that at rest [1]: nothing at rest."""
    plays = [jnp.tanh(steep * whole) - jnp.tanh(steep * rest) for steep in (50.0, 5.0)]
    return [n, n * jnp.abs(n), n**2, n**3, *plays]


def filters(omega: Float[Array, "*f"]) -> list[Complex[Array, "*f"]]:
    """The functions of a sensor at angular frequencies [rad/s]."""
    s = lax.complex(jnp.zeros_like(omega), omega)
    rate = s / RATE
    first = [1.0 / (1.0 + s / corner) - 1.0 for corner in CORNERS]
    second = [1.0 / (1.0 + 1.4 * s / corner + (s / corner) ** 2) - 1.0 for corner in SECOND_CORNERS]
    return [jnp.ones_like(s), rate, rate**2, *first, *second]


def functions_at(port: Port) -> tuple[Function, ...]:
    """The functions of the learned law at a port; none where nothing is learned."""
    if port.kind is PortKind.FORCE:
        return (*OF_THE_MOTION, *OF_SLIDERS, *(OF_THE_LOAD if port.loaded else ()))
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


def interactions_at(port: Port) -> tuple[str, ...]:
    """Names of the coefficients of products of displacement and velocity at a port."""
    both = zip(coefficients_at(port), functions_at(port), strict=True)
    return tuple(name for name, function in both if function.interaction)


def frictions_at(port: Port) -> tuple[str, ...]:
    """Names of the coefficients of frictions at a port; with all at zero, what remains is smooth at rest."""
    return coefficients_of(port, Family.FRICTION)
