"""How the effects of a plant act together at one instant.

Forces at a port add up; what gives way in the path of one load adds up too; all limits of friction of a contact load
one bristle. A plant makes an :class:`EffectsAtInstant` for one evaluation of its residual and asks it port by port.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.effects.alternatives import Alternatives, AtOnePort, Push
from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    AbstractInputLaw,
    AbstractNumberLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
    Bristle,
    FrictionLimit,
    Fundamental,
    InputSignal,
    InternalState,
    Load,
    Port,
    PortKind,
    PortSignals,
    Presliding,
    bristle,
)
from savgs_ident.effects.effect import Effect


def added(effects: tuple[Effect, ...], effect: Effect) -> tuple[Effect, ...]:
    """The effects and one more. Raises :class:`InputError` for one that is there already."""
    if effect.name in (present.name for present in effects):
        raise InputError(f"effect '{effect.name}' is in the model already")
    return (*effects, effect)


def nothing_imposed(ports: Iterable[Port], like: Float[Array, "*n"]) -> dict[str, Array]:
    """Zeros by the name of every port where a signal can be imposed, shaped like ``like``.

    At a force port it is a force; at a series port it is by how much something gives way, and how fast: (2,); at an
    input port it is a value on top of the recorded one and its rate: (2,).
    """
    both = (*like.shape, 2)
    shapes = {PortKind.FORCE: like.shape, PortKind.SERIES: both, PortKind.INPUT: both}
    return {port.name: jnp.zeros(shapes[port.kind], like.dtype) for port in ports if port.kind in shapes}


class _AtOnePort(NamedTuple):
    """A force law at one of several ports, with its states and their rates."""

    law: AtOnePort
    states: str
    state: Float[Array, " s"]
    rate: Float[Array, " s"]


class SeriesDeflection(NamedTuple):
    """By how much what is in series gives way, and how fast [the port's unit, and that per second]."""

    displacement: Float[Array, ""]
    velocity: Float[Array, ""]


class _Part(NamedTuple):
    """An effect with its states and their rates.

    Of alternatives, which share their ``states``, the one that is ``chosen`` acts; other effects always do.
    """

    effect: Effect
    states: str
    state: Float[Array, " s"]
    rate: Float[Array, " s"]
    chosen: Bool[Array, ""] | None = None

    def acting(self, value: Array, otherwise: Array | float = 0.0) -> Array:
        """A value if it acts."""
        return value if self.chosen is None else jnp.where(self.chosen, value, otherwise)


def sticking_contacts(effects: Sequence[Effect]) -> tuple[Port, ...]:
    """The ports at which a friction limit loads a bristle, in the order of the effects.

    A force that adds to what a contact holds makes no contact by itself.
    """
    found: dict[str, Port] = {}
    for effect in effects:
        if isinstance(effect.law, AbstractFrictionLimitLaw):
            found.setdefault(effect.port.name, effect.port)
    return tuple(found.values())


def states_of(effects: Sequence[Effect]) -> tuple[InternalState, ...]:
    """Internal states: the anchors of the contacts that stick, then those of all effects in their order."""
    contacts = sticking_contacts(effects)
    anchors = tuple(
        InternalState(
            "anchor" if len(contacts) == 1 else f"{port.name}_anchor",
            port.displacement_unit,
            port.displacement,
            slips=True,
        )
        for port in contacts
    )
    return (*anchors, *(state for effect in effects for state in effect.states))


def changed_numbers(effects: Sequence[Effect], p: Values) -> Values:
    """The plant's parameters with all changes made, SI."""
    for effect in effects:
        if isinstance(effect.law, AbstractNumberLaw):
            p = dict(p) | dict(effect.changes(p))
    return p


def sensor_transfer(
    effects: Sequence[Effect], location: str, p: Values, frequency: Float[Array, "*f"]
) -> Complex[Array, "*f"]:
    """Reading over truth of the sensor at a location, at frequencies [Hz]."""
    transfer = jnp.ones_like(frequency, dtype=jnp.complex128)
    for effect in effects:
        if isinstance(effect.law, AbstractSensorLaw) and effect.port.location == location:
            transfer = transfer * effect.transfer(p, frequency)
    return transfer


def contact_bristle(
    effects: Sequence[Effect],
    port: Port,
    p: Values,
    signals: PortSignals,
    anchor: Float[Array, ""],
    beside: Iterable[FrictionLimit] = (),
) -> Bristle:
    """The bristle of the contact at a port, in state ``anchor``, under the friction limits of all effects there.

    And under those ``beside`` [N].
    """
    assert port.contact is not None
    up, down = jnp.zeros_like(signals.load), jnp.zeros_like(signals.load)
    there = (each for each in effects if each.loads_contact and each.port.name == port.name)
    for share in (*(each.friction_limit(p, signals) for each in there), *beside):
        up, down = up + share.against_up, down + share.against_down
    stick = Presliding(*(p[name] for name in port.contact))
    force, rate = bristle(stick, signals, FrictionLimit(up, down), anchor)
    return Bristle(force, rate / port.time_scale)


class EffectsAtInstant:
    """The effects of a plant at one instant, with parameters ``p``.

    ``s`` and ``sd`` are the states and their rates, (s,) [unit of each]: first ``own`` ones of the plant itself, then
    those of the effects, in the order of :func:`states_of`, and of the ``alternatives``;
    ``imposed`` are signals imposed from outside, as :func:`nothing_imposed` arranges them.

    Attributes:
        own: internal states of the plant itself, (o,), which are none of the effects'; ``own_rates`` their rates.
        signals: what the forces at each port see, by the port's name.
        loads: the load in which something may give way, by the port's name.
        forces: the force at each force port, by its name; where the plant has an element of its own there and
            reports it (:meth:`report`), the whole of both.
    """

    def __init__(
        self,
        effects: Sequence[Effect],
        p: Values,
        s: Array,
        sd: Array,
        imposed: Mapping[str, Array] | None = None,
        own: int = 0,
        alternatives: Sequence[Alternatives | AtOnePort] = (),
    ) -> None:
        self.p = p
        self.own, self.own_rates = s[:own], sd[:own]
        s, sd = s[own:], sd[own:]
        self._imposed = imposed or {}
        self.signals: dict[str, PortSignals] = {}
        self.loads: dict[str, Load] = {}
        self._contacts = sticking_contacts(effects)
        self._s, self._sd = s, sd
        self.forces: dict[str, Array] = {}
        self._effects = effects
        self._pushes: dict[str, list[Push]] = {}
        self._out_of_balance: dict[str, Array] = {}
        self._parts: list[_Part] = []
        self._at_one_port: list[_AtOnePort] = []
        self._order: list[str] = []
        start = len(self._contacts)
        for effect in effects:
            mine = slice(start, start + len(effect.states))
            self._parts.append(_Part(effect, effect.name, s[mine], sd[mine]))
            self._order += [effect.name] if effect.states else []
            start = mine.stop
        for number, several in enumerate(alternatives, start=1):
            mine = slice(start, start + len(several.states))
            shared = f"alternatives {number}", s[mine], sd[mine]
            self._order.append(shared[0])
            start = mine.stop
            if isinstance(several, AtOnePort):
                self._at_one_port.append(_AtOnePort(several, *shared))
            else:
                self._parts += [_Part(each, *shared, several.acts(each)) for each in several.effects]

    def _at(self, port: Port, kind: type) -> Iterator[_Part]:
        for part in self._parts:
            if isinstance(part.effect.law, kind) and part.effect.port.name == port.name:
                yield part

    def deflection(self, port: Port) -> SeriesDeflection:
        """How everything in series at a port gives way, what is imposed there included."""
        given = self._imposed.get(port.name, jnp.zeros(2))
        found = SeriesDeflection(given[0], given[1])
        for part in self._at(port, AbstractSeriesLaw):
            way, rate = part.acting(part.state[0]), part.acting(part.rate[0])
            found = SeriesDeflection(found.displacement + way, found.velocity + rate)
        return found

    def carry(self, port: Port, total: Float[Array, ""], rest: Float[Array, ""]) -> None:
        """Put everything in series at a port under its load, of which ``rest`` is there in the nominal state.

        Loads are in the port's unit of force.
        """
        load = Load(total, rest)
        self.loads[port.name] = load
        for part in self._at(port, AbstractSeriesLaw):
            self._leave(part, part.effect.balance(self.p, load, part.state, part.rate))

    def force(self, port: Port, signals: PortSignals) -> Float[Array, ""]:
        """Force of all effects at a port, that of a contact that sticks and what is imposed there included [N]."""
        self.signals[port.name] = signals
        total = self._imposed.get(port.name, jnp.zeros_like(signals.displacement))
        for part in self._at(port, AbstractForceLaw):
            total = total + part.acting(part.effect.force(self.p, signals, part.state))
            self._leave(part, part.rate - part.effect.rate(self.p, signals, part.state))
        pushes = self._pushes.get(port.name, [])
        total = sum((each.force for each in pushes), total)
        contacts = [each.name for each in self._contacts]
        if port.name in contacts:
            place, beside = contacts.index(port.name), [each.limit for each in pushes]
            contact = self._contacts[place]
            held = contact_bristle(self._effects, contact, self.p, signals, self._s[place], beside)
            total = total + held.force
            self._out_of_balance[_anchor_of(port)] = self._sd[place] - held.rate
        self.forces[port.name] = total
        return total

    @property
    def lacks_forces(self) -> bool:
        """Whether laws that act at one of several ports wait for what these see; :meth:`push` has them act."""
        return bool(self._at_one_port)

    def push(self) -> None:
        """Have laws that act at one of several ports act there, by what these saw without them."""
        for each in self._at_one_port:
            for name, push in each.law.push(self.p, self.signals, each.state).items():
                self._pushes.setdefault(name, []).append(push)
                self._out_of_balance[each.states] = each.rate - push.rate

    def report(self, port: Port, whole: Float[Array, ""]) -> None:
        """Record the whole force at a port, the plant's own element included, for whoever draws it."""
        self.forces[port.name] = whole

    def input(self, port: Port, recorded: InputSignal, fundamental: Fundamental | None) -> InputSignal:
        """What an input does, all its faults and what is imposed there added to what is recorded.

        Without a ``fundamental``, as in a test that is not periodic, its angle is zero.
        """
        given = self._imposed.get(port.name, jnp.zeros(2))
        value, rate = recorded.value + given[0], recorded.rate + given[1]
        turned = fundamental or Fundamental(jnp.zeros_like(value), jnp.zeros_like(value))
        for part in self._at(port, AbstractInputLaw):
            shift = part.effect.shift(self.p, recorded, turned)
            value, rate = value + shift.value, rate + shift.rate
        return InputSignal(value, rate)

    def balance(self) -> Float[Array, " s"]:
        """What vanishes for the right rates of all states, in their order [unit of each, or of its rate]."""
        anchors = [self._out_of_balance[_anchor_of(port)][None] for port in self._contacts]
        balances = [self._out_of_balance[states] for states in self._order]
        return jnp.concatenate([*anchors, *balances] or [jnp.zeros(0)])

    def _leave(self, part: _Part, balance: Float[Array, " s"]) -> None:
        """Record by how much the rates of the states of an effect are out of balance."""
        self._out_of_balance[part.states] = part.acting(balance, self._out_of_balance.get(part.states, 0.0))


def _anchor_of(port: Port) -> str:
    return f"anchor of {port.name}"
