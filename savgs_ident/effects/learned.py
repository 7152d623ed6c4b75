"""Learned laws: the flexible member of every family, for what is there without a formula for it.

A learned law is a sum of known functions of what its port sees, with coefficients that a diagnosis fits:

    port     law                a sum of functions of
    force    LearnedForce       displacement, velocity and load, and of spring-sliders that follow the displacement
    series   LearnedCompliance  the load: by how much something gives way, until it is blocked
    input    LearnedInput       the angle of the test: what comes on top of the recorded value
    sensor   LearnedTransfer    the frequency: what comes on top of a transfer function of one

Every function belongs to a family (:class:`~savgs_ident.effects.base.Family`): those of one family alone are its
flexible member, all together the general law of the port. With all coefficients at zero, as :func:`learned_effect`
gives it, the law vanishes. The functions are held at the edge of what was seen when the law was learned: it says
nothing about what lies beyond.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.alternatives import AtOnePort
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
from savgs_ident.effects.effect import Effect, typical_effect
from savgs_ident.effects.learned_functions import (
    FALL,
    GAP,
    LAG,
    OF_A_CONTACT,
    OF_A_FALL,
    OF_A_LOADED_FALL,
    OF_CONTACTS,
    OF_SLIDERS,
    OF_THE_ANGLE,
    OF_THE_FREQUENCY,
    OF_THE_LOAD,
    OF_THE_MOTION,
    OF_WHAT_GIVES,
    SMALLEST,
    STRETCHES,
    TURN,
    RelativeAngle,
    RelativeMotion,
    filters,
    functions_at,
    values_of,
    what_gives,
)

ANYWHERE = Port("anywhere", PortKind.FORCE, "anywhere", loaded=True, contact=("stiffness", "damping"))
"""A force port that has the functions of all force ports; it is none of a plant's."""

BLOCKED_AS = 8
"""Exponent with which a play is blocked at its ends [1]."""


def _time(name: str, usual: float, lower: float, upper: float, port: Port, about: str) -> Parameter:
    """A time [s] that is estimated along, and its bounds, each of them on a time scale of 1."""
    scale = port.time_scale
    return Parameter(name, usual * scale, "s", lower=lower * scale, upper=upper * scale, about=about)


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
    """A learned force at a ``port``, in the port's own sense: F = sum over k of c_k f_k(x, v, n).

    Where something sticks, the contact holds more by one of the coefficients, whatever it carries.
    """

    name: ClassVar[str] = "learned"
    family: ClassVar[Family] = Family.LEARNED
    holds_states: ClassVar[bool] = True
    drags_anchors: ClassVar[bool] = True
    roles: ClassVar[tuple[Role, ...]] = _roles(
        ("middle", "stroke", "speed", "carried", "typical", "turn", "give", "gap", "fall", "lag"),
        len(
            (
                *OF_THE_MOTION,
                *OF_SLIDERS,
                *OF_THE_LOAD,
                *OF_CONTACTS,
                OF_A_FALL,
                OF_A_LOADED_FALL,
                OF_A_CONTACT,
            )
        ),
    )
    port: Port = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Nothing learned yet."""
        unit, force = port.displacement_unit, port.force_unit
        carried = Parameter("carried", 1.0, force, lower=SMALLEST, about="largest load seen")
        turn = "velocity over which a friction turns round, over the largest seen"
        give = "how far spring-sliders give before they slide, over what their functions say"
        gap = "displacement at which contacts begin, over the stroke"
        fall = "velocity over which a friction falls, over the largest seen"
        lag = "damping over stiffness of spring-sliders"
        spans = {
            "middle": Parameter("middle", 0.0, unit, about="displacement in the middle of what was seen"),
            "stroke": Parameter("stroke", 1.0, unit, lower=SMALLEST, about="largest displacement from there"),
            "speed": Parameter("speed", 1.0, f"{unit}/s", lower=SMALLEST, about="largest velocity seen"),
            "carried": carried if port.loaded else 1.0,
            "typical": port.displacement,
            "turn": Parameter("turn", TURN, "1", lower=0.1 * TURN, upper=10.0 * TURN, about=turn),
            "give": Parameter("give", 1.0, "1", lower=0.05, upper=5.0, about=give),
            "gap": Parameter("gap", GAP, "1", lower=0.02, upper=0.9, about=gap),
            "fall": Parameter("fall", FALL, "1", lower=0.02, upper=1.0, about=fall),
            "lag": _time("lag", LAG, 1e-5, 0.03, port, lag),
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
        return port.name == self.port.name

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The learned force [N]."""
        x = jnp.clip((signals.displacement - v["middle"]) / v["stroke"], -1.0, 1.0)
        speed = jnp.clip(signals.velocity / v["speed"], -1.0, 1.0)
        n = jnp.clip(signals.load / v["carried"], -1.0, 1.0) if self.port.loaded else jnp.zeros_like(x)
        whole = jnp.abs(v["middle"]) + v["stroke"]
        d = jnp.clip(signals.displacement / whole, -1.0, 1.0)
        held = [-each.force for each in self._sliders(v, signals, state)]
        seen = RelativeMotion(x, d, speed, n, v["turn"], v["gap"], v["fall"], held)
        return self.port.sense * _sum(v, values_of(functions_at(self.port), seen))

    def rate(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """Velocities of the anchors [m/s]."""
        return jnp.stack([each.rate for each in self._sliders(v, signals, state)])

    def bounds_of_states(
        self, v: Values, signals: PortSignals
    ) -> tuple[Float[Array, "s *n"], Float[Array, "s *n"]]:
        """The bounds [m] of the anchors."""
        moved, widths = signals.displacement - signals.rest, self._widths(v)
        return jnp.stack([moved - each for each in widths]), jnp.stack([moved + each for each in widths])

    def loads_contact(self, port: Port) -> bool:
        """Where there is one."""
        return port.contact is not None

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        """What the contact holds beside what it holds already, the same both ways [N]."""
        number = functions_at(self.port).index(OF_A_CONTACT) + 1
        held = v[str(number)] * jnp.ones_like(signals.load)
        return FrictionLimit(held, held)

    def _widths(self, v: Values) -> list[Array]:
        """How far each gives before it slides [m]."""
        return [share * v["typical"] * v["give"] for share in STRETCHES]

    def _sliders(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> list[Bristle]:
        """Spring-sliders of unit friction: what they carry is a function of the motion alone."""
        one = jnp.ones_like(signals.displacement)
        limit = FrictionLimit(one, one)
        moved = signals._replace(displacement=signals.displacement - signals.rest)
        sticks = [Presliding(one / width, one * (v["lag"] / width)) for width in self._widths(v)]
        return [bristle(stick, moved, limit, state[place]) for place, stick in enumerate(sticks)]


class LearnedCompliance(AbstractSeriesLaw):
    """What gives way under a load by a learned law, until it is blocked.

        T xd + x (1 + (b x / x_t)^8) = sum over k of c_k f_k(n, N)

    with the deflection x, the typical one x_t of the port, the time T [s] in which it gives way, and b [1], x_t over
    the deflection at which it is blocked; nothing blocks it with b = 0.
    """

    name: ClassVar[str] = "learned_compliance"
    family: ClassVar[Family] = Family.LEARNED
    roles: ClassVar[tuple[Role, ...]] = (
        *_roles(("carried", "lag"), len(OF_WHAT_GIVES)),
        Role("blocking", 0.0),
    )
    port: Port = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Nothing learned yet."""
        spans = {
            "carried": Parameter("carried", 1.0, port.force_unit, lower=SMALLEST, about="largest load seen"),
            "lag": _time("lag", 3e-3, 1e-5, 0.1, port, "time in which it gives way"),
        }
        about = "typical displacement over that at which it is blocked"
        blocking = Parameter("blocking", 0.0, "1", lower=0.0, upper=1e3, about=about)
        return spans | _coefficients(port, port.displacement_unit) | {"blocking": blocking}

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The deflection."""
        return (InternalState("deflection", port.displacement_unit, port.displacement),)

    def suits(self, port: Port) -> bool:
        """Only where it was made for."""
        return port.name == self.port.name

    def balance(
        self, v: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The deflection out of balance [the port's unit]."""
        n = jnp.clip(load.beyond_rest / v["carried"], -1.0, 1.0)
        whole, rest = load.total / v["carried"], load.rest / v["carried"]
        held = state * (1.0 + (v["blocking"] * state / self.port.displacement) ** BLOCKED_AS)
        return jnp.sqrt(v["lag"] ** 2 + SETTLING**2) * rate + held - _sum(v, what_gives(n, whole, rest))


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
        return port.name == self.port.name

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """The learned value and its rate."""
        relative = fundamental.speed / v["fastest"]

        def learned(angle: Float[Array, ""]) -> Float[Array, ""]:
            return _sum(v, values_of(OF_THE_ANGLE, RelativeAngle(angle, relative)))

        value, slope = jax.jvp(learned, (fundamental.angle,), (jnp.ones_like(fundamental.angle),))
        return InputSignal(value, fundamental.speed * slope)


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
        return port.name == self.port.name

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        found = filters(2.0 * jnp.pi * frequency * self.port.time_scale)
        real, imaginary = (_sum(v, [part(each) for each in found]) for part in (jnp.real, jnp.imag))
        return lax.complex(1.0 + real, imaginary)


class SharedForce(NamedTuple):
    """A learned force at one of several ports.

    Attributes:
        law: as programs have it that serve all these ports.
        numbers: by the name of each number of such a program, the name of the effect's own, or a number [SI].
    """

    law: AtOnePort
    numbers: Mapping[str, str | float]

    def values(self, p: Values) -> Values:
        """The parameters with the effect's own under the names of the program, SI."""
        own, gone = self.numbers.items(), set(self.numbers.values())
        there = {name: p[each] if isinstance(each, str) else jnp.asarray(each, float) for name, each in own}
        return {name: value for name, value in p.items() if name not in gone} | there

    def names(self, given: Iterable[str]) -> list[str]:
        """The names that the program has for the ``given`` ones."""
        theirs = {each: name for name, each in self.numbers.items()}
        return [theirs.get(each, each) for each in given]


def shared_force(effect: Effect, ports: Iterable[Port]) -> SharedForce:
    """The learned force of an ``effect`` as one that may act at any of the force ``ports``."""
    forces = tuple(each for each in ports if each.kind is PortKind.FORCE)
    own, here = dict(effect.numbers), functions_at(effect.port)
    # A function has another number where the port has others before it, and none where the port lacks it.
    theirs = {
        str(number): own[str(here.index(each) + 1)] if each in here else 0.0
        for number, each in enumerate(functions_at(ANYWHERE), start=1)
    }
    names = {role: f"{ANYWHERE.name}_{role}" for role in own}
    law = typical_effect(ANYWHERE.name, ANYWHERE, LearnedForce(ANYWHERE), names)
    place = [each.name for each in forces].index(effect.port.name)
    return SharedForce(
        AtOnePort(law, forces, jnp.asarray(place)),
        {names[role]: theirs.get(role, given) for role, given in own.items()},
    )


_Law = LearnedForce | LearnedCompliance | LearnedInput | LearnedTransfer

_LAWS: Mapping[PortKind, Callable[[Port], _Law]] = {
    PortKind.FORCE: LearnedForce,
    PortKind.SERIES: LearnedCompliance,
    PortKind.INPUT: LearnedInput,
    PortKind.SENSOR: LearnedTransfer,
}


def learned_effect(port: Port) -> Effect:
    """The learned law of a port, with nothing learned yet: ``learned_rail`` at the port ``rail``."""
    return typical_effect(
        f"learned_{port.name}",
        port,
        _LAWS[port.kind](port),
        symptom="no effect of the catalogue explains what is measured",
        reference="this project: linear regression on functions of what the port sees",
    )
