"""Learned laws: the flexible member of every family, for what is there without a formula for it.

A learned law is a sum of known functions of what its port sees, with coefficients that a diagnosis fits:

    port     law                a sum of functions of
    force    LearnedForce       displacement, velocity and load, and of spring-sliders that follow the displacement
    series   LearnedCompliance  the load: by how much something gives way
    input    LearnedInput       the angle of the test: what comes on top of the recorded value
    sensor   LearnedTransfer    the frequency: what comes on top of a transfer function of one

Every function belongs to a family (:class:`~savgs_ident.effects.base.Family`): those of one family alone are its
flexible member, all together the general law of the port. With all coefficients at zero, as :func:`learned_effect`
gives it, the law vanishes. The functions are held at the edge of what was seen when the law was learned: it says
nothing about what lies beyond.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    SETTLING,
    AbstractForceLaw,
    AbstractInputLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
    Bristle,
    Family,
    FrictionLimit,
    Fundamental,
    InputSignal,
    InternalState,
    Load,
    Port,
    PortKind,
    PortSignals,
    Presliding,
    Role,
    bristle,
)
from savgs_ident.effects.effect import Effect, effect_at


class Function(NamedTuple):
    """A function of a learned law: in words, and the family to which it belongs."""

    words: str
    family: Family


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

SLIDER_LAG = 3e-4
"""Damping over stiffness of a spring-slider [s]."""

OF_THE_MOTION = (
    Function("tanh(v/0.01)", Family.FRICTION),
    Function("tanh(v/0.1)", Family.FRICTION),
    Function("v", Family.DAMPING),
    Function("v|v|", Family.DAMPING),
    Function("v^2", Family.DAMPING),
    Function("x", Family.STIFFNESS),
    Function("x^2", Family.STIFFNESS),
    Function("x^3", Family.STIFFNESS),
    Function("x tanh(v/0.01)", Family.FRICTION),
    Function("x v", Family.DAMPING),
    Function("x^2 v", Family.DAMPING),
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


def frictions_at(port: Port) -> tuple[str, ...]:
    """Names of the coefficients of frictions at a port; with all at zero, what remains is smooth at rest."""
    return coefficients_of(port, Family.FRICTION)


def _coefficients(port: Port, unit: str) -> dict[str, Parameter | float]:
    """By role, a coefficient for every function of the port: nothing learned yet."""
    return {
        str(number): Parameter(str(number), 0.0, unit, about=f"learned in proportion to {each.words}")
        for number, each in enumerate(functions_at(port), start=1)
    }


def _roles(spans: tuple[str, ...], count: int) -> tuple[Role, ...]:
    return (*(Role(span) for span in spans), *(Role(str(number), 0.0) for number in range(1, count + 1)))


def _sum(v: Values, values: list[Array]) -> Array:
    """The functions in proportion to their coefficients."""
    return sum((v[str(k)] * value for k, value in enumerate(values[1:], start=2)), v["1"] * values[0])


class LearnedForce(AbstractForceLaw):
    """A learned force at a ``port``, in the port's own sense: F = sum over k of c_k f_k(x, v, n)."""

    name: ClassVar[str] = "learned"
    family: ClassVar[Family] = Family.LEARNED
    roles: ClassVar[tuple[Role, ...]] = _roles(
        ("middle", "stroke", "speed", "carried", "turn"), len((*OF_THE_MOTION, *OF_SLIDERS, *OF_THE_LOAD))
    )
    port: Port = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Nothing learned yet."""
        unit, force = port.displacement_unit, port.force_unit
        carried = Parameter("carried", 1.0, force, lower=SMALLEST, about="largest load seen")
        turn = "velocity over which a friction turns round, over the largest seen"
        spans = {
            "middle": Parameter("middle", 0.0, unit, about="displacement in the middle of what was seen"),
            "stroke": Parameter("stroke", 1.0, unit, lower=SMALLEST, about="largest displacement from there"),
            "speed": Parameter("speed", 1.0, f"{unit}/s", lower=SMALLEST, about="largest velocity seen"),
            "carried": carried if port.loaded else 1.0,
            "turn": Parameter("turn", TURN, "1", lower=0.1 * TURN, upper=10.0 * TURN, about=turn),
        }
        return {role.name: 0.0 for role in self.roles} | spans | _coefficients(port, force)

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """Where the spring-sliders are anchored."""
        return tuple(
            InternalState(f"anchor_{number}", port.displacement_unit, port.displacement, slips=True)
            for number, _ in enumerate(STRETCHES, start=1)
        )

    def suits(self, port: Port) -> bool:
        """Only where it was made for."""
        return port == self.port

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The learned force [N]."""
        x = jnp.clip((signals.displacement - v["middle"]) / v["stroke"], -1.0, 1.0)
        speed = jnp.clip(signals.velocity / v["speed"], -1.0, 1.0)
        n = jnp.clip(signals.load / v["carried"], -1.0, 1.0) if self.port.loaded else jnp.zeros_like(x)
        whole = jnp.abs(v["middle"]) + v["stroke"]
        d = jnp.clip(signals.displacement / whole, -1.0, 1.0)
        found = functions(x, d, speed, n, v["turn"])
        motion, load = found[: len(OF_THE_MOTION)], found[len(OF_THE_MOTION) :]
        sliders = [-each.force for each in self._sliders(signals, state)]
        return self.port.sense * _sum(v, [*motion, *sliders, *(load if self.port.loaded else [])])

    def rate(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """Velocities of the anchors [m/s]."""
        return jnp.stack([each.rate for each in self._sliders(signals, state)])

    def _sliders(self, signals: PortSignals, state: Float[Array, " s"]) -> list[Bristle]:
        """Spring-sliders of unit friction: what they carry is a function of the motion alone."""
        one = jnp.ones_like(signals.displacement)
        limit = FrictionLimit(one, one)
        moved = signals._replace(displacement=signals.displacement - signals.rest)
        widths = [share * self.port.displacement for share in STRETCHES]
        sticks = [Presliding(one / width, one * (SLIDER_LAG / width)) for width in widths]
        return [bristle(stick, moved, limit, state[place]) for place, stick in enumerate(sticks)]


class LearnedCompliance(AbstractSeriesLaw):
    """What gives way under a load by a learned law: x + T xd = sum over k of c_k f_k(n, N)."""

    name: ClassVar[str] = "learned_compliance"
    family: ClassVar[Family] = Family.LEARNED
    roles: ClassVar[tuple[Role, ...]] = _roles(("carried", "lag"), len(OF_WHAT_GIVES))
    port: Port = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Nothing learned yet."""
        spans = {
            "carried": Parameter("carried", 1.0, port.force_unit, lower=SMALLEST, about="largest load seen"),
            "lag": Parameter("lag", 3e-4, "s", lower=1e-5, upper=0.1, about="time in which it gives way"),
        }
        return spans | _coefficients(port, port.displacement_unit)

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The deflection."""
        return (InternalState("deflection", port.displacement_unit, port.displacement),)

    def suits(self, port: Port) -> bool:
        """Only where it was made for."""
        return port == self.port

    def balance(
        self, v: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The deflection out of balance [the port's unit]."""
        n = jnp.clip(load.beyond_rest / v["carried"], -1.0, 1.0)
        whole, rest = load.total / v["carried"], load.rest / v["carried"]
        return jnp.sqrt(v["lag"] ** 2 + SETTLING**2) * rate + state - _sum(v, what_gives(n, whole, rest))


class LearnedInput(AbstractInputLaw):
    """What comes on top of a recorded input by a learned law of its angle."""

    name: ClassVar[str] = "learned_input"
    family: ClassVar[Family] = Family.LEARNED
    roles: ClassVar[tuple[Role, ...]] = _roles(("fastest",), len(OF_THE_ANGLE))
    port: Port = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Nothing learned yet."""
        fastest = Parameter("fastest", 1.0, "rad/s", lower=SMALLEST, about="greatest speed of the angle seen")
        return {"fastest": fastest} | _coefficients(port, port.displacement_unit)

    def suits(self, port: Port) -> bool:
        """Only where it was made for."""
        return port == self.port

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """The learned value and its rate."""
        angle, speed = fundamental
        relative = speed / v["fastest"]
        value, slope = [], []
        for order in ORDERS:
            value += [jnp.cos(order * angle), jnp.sin(order * angle)]
            slope += [-order * jnp.sin(order * angle), order * jnp.cos(order * angle)]
        value += [relative * jnp.sin(angle), relative * jnp.cos(angle)]
        slope += [relative * jnp.cos(angle), -relative * jnp.sin(angle)]
        return InputSignal(_sum(v, value), speed * _sum(v, slope))


class LearnedTransfer(AbstractSensorLaw):
    """A sensor with a learned transfer function: 1 + sum over k of c_k H_k(s)."""

    name: ClassVar[str] = "learned_transfer"
    family: ClassVar[Family] = Family.LEARNED
    roles: ClassVar[tuple[Role, ...]] = _roles((), len(OF_THE_FREQUENCY))
    port: Port = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Nothing learned yet."""
        return _coefficients(port, "1")

    def suits(self, port: Port) -> bool:
        """Only where it was made for."""
        return port == self.port

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        found = filters(2.0 * jnp.pi * frequency)
        real, imaginary = (_sum(v, [part(each) for each in found]) for part in (jnp.real, jnp.imag))
        return lax.complex(1.0 + real, imaginary)


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


_Law = LearnedForce | LearnedCompliance | LearnedInput | LearnedTransfer

_LAWS: Mapping[PortKind, Callable[[Port], _Law]] = {
    PortKind.FORCE: LearnedForce,
    PortKind.SERIES: LearnedCompliance,
    PortKind.INPUT: LearnedInput,
    PortKind.SENSOR: LearnedTransfer,
}


def learned_effect(port: Port) -> Effect:
    """The learned law of a port, with nothing learned yet: ``learned_rail`` at the port ``rail``."""
    law, name = _LAWS[port.kind](port), f"learned_{port.name}"
    numbers = {
        role: replace(given, name=f"{name}_{role}") if isinstance(given, Parameter) else given
        for role, given in law.typical(port).items()
    }
    return effect_at(
        name,
        port,
        law,
        numbers,
        states=tuple(f"{name}_{each.name}" for each in law.states(port)),
        symptom="no effect of the catalogue explains what is measured",
        reference="this project: linear regression on functions of what the port sees",
    )
