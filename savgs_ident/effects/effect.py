"""An effect: a law at a port, under a name, with a parameter for every number that the law takes.

A plant without a catalogue has every law at every port that it suits, with typical sizes from the port:

    effects = generic_effects(plant.scaled_ports)

Such an effect is named after its port and its law: ``suspension_viscous``. At a number port there is one for each
number: ``inertia_m_s_offset``.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    AbstractInputLaw,
    AbstractLaw,
    AbstractNumberLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
    Family,
    FrictionLimit,
    Fundamental,
    InputSignal,
    InternalState,
    Load,
    Port,
    PortKind,
    PortSignals,
)
from savgs_ident.effects.laws.asymmetry import Asymmetry
from savgs_ident.effects.laws.attached_oscillator import AttachedOscillator
from savgs_ident.effects.laws.backlash import Backlash
from savgs_ident.effects.laws.breakaway import Breakaway
from savgs_ident.effects.laws.compliance import Compliance
from savgs_ident.effects.laws.coulomb import Coulomb
from savgs_ident.effects.laws.delay import Delay
from savgs_ident.effects.laws.gain import Gain
from savgs_ident.effects.laws.input_harmonics import InputHarmonics
from savgs_ident.effects.laws.input_offset import InputOffset
from savgs_ident.effects.laws.input_scale import InputScale
from savgs_ident.effects.laws.lag import Lag
from savgs_ident.effects.laws.linear_stiffness import LinearStiffness
from savgs_ident.effects.laws.massive_compliance import MassiveCompliance
from savgs_ident.effects.laws.offset import Offset
from savgs_ident.effects.laws.one_sided_damping import OneSidedDamping
from savgs_ident.effects.laws.preload import Preload
from savgs_ident.effects.laws.presliding_friction import PreslidingFriction
from savgs_ident.effects.laws.progressive_stiffness import ProgressiveStiffness
from savgs_ident.effects.laws.resonance import Resonance
from savgs_ident.effects.laws.saturating_friction import SaturatingFriction
from savgs_ident.effects.laws.scale import Scale
from savgs_ident.effects.laws.stop import LowerStop, UpperStop
from savgs_ident.effects.laws.stribeck import Stribeck
from savgs_ident.effects.laws.tilt import Tilt
from savgs_ident.effects.laws.viscous import Viscous


class Effect(eqx.Module):
    """A law at a port under a name.

    Attributes:
        name: in files and reports, unique within a catalogue.
        port: where the law acts.
        law: what it does.
        parameters: that come with the effect, in SI.
        numbers: by role of the law, the name of a parameter, be it the effect's or the plant's, or a number [SI] that
            stays as it is.
        state_names: of the law's internal states; those of the law where there are none.
        symptom: by what it shows in measurements.
        reference: where the law is from.
    """

    name: str = eqx.field(static=True)
    port: Port = eqx.field(static=True)
    law: AbstractLaw
    parameters: tuple[Parameter, ...] = eqx.field(static=True)
    numbers: tuple[tuple[str, str | float], ...] = eqx.field(static=True)
    state_names: tuple[str, ...] = eqx.field(static=True, default=())
    symptom: str = eqx.field(static=True, default="")
    reference: str = eqx.field(static=True, default="")

    def __check_init__(self) -> None:
        if self.law.kind is not self.port.kind:
            raise ValueError(f"'{self.name}': {self.law.name} is no law of a {self.port.kind.value} port")
        if [role for role, _ in self.numbers] != [role.name for role in self.law.roles]:
            raise ValueError(f"'{self.name}' does not give {self.law.name} the numbers that it takes")

    @property
    def null(self) -> Mapping[str, float]:
        """Values of its parameters, by name, at which it vanishes."""
        names = dict(self.numbers)
        found = {names[role.name]: role.null for role in self.law.roles if role.null is not None}
        return {name: null for name, null in found.items() if isinstance(name, str)}

    @property
    def number(self) -> str | None:
        """Name of the plant's number that it changes; None for all but laws of a number."""
        changed = dict(self.numbers).get("number")
        return None if changed is None else str(changed)

    @property
    def linear_part_of(self) -> Family:
        """What kind of law the number is the linear part of that it changes; else that of its own law."""
        return next((each.of for each in self.port.numbers if each.name == self.number), self.law.family)

    @property
    def loads_contact(self) -> bool:
        """Whether it has a share of what the contact at its port holds."""
        law = self.law
        only = isinstance(law, AbstractFrictionLimitLaw)
        return only or (isinstance(law, AbstractForceLaw) and law.loads_contact(self.port))

    @property
    def states(self) -> tuple[InternalState, ...]:
        """Internal states under the names of this effect."""
        own = self.law.states(self.port)
        names = self.state_names or tuple(state.name for state in own)
        return tuple(state._replace(name=name) for state, name in zip(own, names, strict=True))

    @property
    def tried(self) -> tuple[Mapping[str, float], ...]:
        """Values [SI] of its shapes at which a diagnosis looks for it, if not at multiples of the typical ones."""
        names = dict(self.numbers)
        return tuple({str(names[role]): value} for role, value in self.law.tried(self.port))

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """Its force in the sense of the port [the port's unit], with parameters ``p``."""
        assert isinstance(self.law, AbstractForceLaw), self.name
        return self.port.sense * self.law.force(self.by_role(p), signals, state)

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """Time derivatives of its states where it is a force, (s,) [unit of each per second]."""
        assert isinstance(self.law, AbstractForceLaw), self.name
        rate = self.law.rate(self.by_role(p), signals, state)
        return rate / self.port.time_scale if self.law.drags_anchors else rate

    @property
    def holds_states(self) -> bool:
        """Whether the motion of its port alone holds its states."""
        return isinstance(self.law, AbstractForceLaw) and self.law.holds_states

    def bounds_of_states(
        self, p: Values, signals: PortSignals
    ) -> tuple[Float[Array, "s *n"], Float[Array, "s *n"]]:
        """The bounds between which the motion holds them [unit of each], lower and upper."""
        assert isinstance(self.law, AbstractForceLaw), self.name
        return self.law.bounds_of_states(self.by_role(p), signals)

    def friction_limit(self, p: Values, signals: PortSignals) -> FrictionLimit:
        """Its share of what a contact holds [N]."""
        assert isinstance(self.law, AbstractFrictionLimitLaw | AbstractForceLaw), self.name
        return self.law.limit(self.by_role(p), signals)

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """What vanishes for the right rates where it gives way, (s,) [unit of each state]."""
        assert isinstance(self.law, AbstractSeriesLaw), self.name
        return self.law.balance(self.by_role(p), load, state, rate)

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The plant's number that it changes, by name, SI."""
        assert isinstance(self.law, AbstractNumberLaw), self.name
        return {str(self.number): self.law.changed(self.by_role(p))}

    def shift(self, p: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """What comes on top of a recorded input, value and rate."""
        assert isinstance(self.law, AbstractInputLaw), self.name
        return self.law.shift(self.by_role(p), signal, fundamental)

    def transfer(self, p: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth of the sensor at frequencies [Hz]."""
        assert isinstance(self.law, AbstractSensorLaw), self.name
        return self.law.transfer(self.by_role(p), frequency)

    def sized(self, port: Port) -> "Effect":
        """The effect with the typical numbers that its law has for the sizes of ``port``, in place of its own port's.

        Numbers that are not the typical ones, as those of effects that a plant brings along, stay as they are.
        """
        here, there = self.law.typical(self.port), self.law.typical(port)
        own = {each.name: each for each in self.parameters}
        numbers: list[tuple[str, str | float]] = []
        for role, given in self.numbers:
            typical, other = here.get(role), there.get(role)
            if isinstance(given, str):
                numbers.append((role, given))
                mine = own.get(given)
                if isinstance(typical, Parameter) and isinstance(other, Parameter) and mine is not None:
                    own[given] = replace(other, name=given) if mine == replace(typical, name=given) else mine
            else:
                typically = given == typical and isinstance(other, float)
                numbers.append((role, other if typically and isinstance(other, float) else given))
        resized = tuple(own[each.name] for each in self.parameters)
        return replace(self, port=port, parameters=resized, numbers=tuple(numbers))

    def by_role(self, p: Values) -> Values:
        """The law's numbers by role, SI."""
        return {
            role: p[given] if isinstance(given, str) else jnp.asarray(given, float)
            for role, given in self.numbers
        }


def effect_at(
    name: str,
    port: Port,
    law: AbstractLaw,
    numbers: Mapping[str, Parameter | str | float],
    *,
    brings: tuple[Parameter, ...] = (),
    states: tuple[str, ...] = (),
    symptom: str = "",
    reference: str = "",
) -> Effect:
    """A law at a port: for every role a parameter of its own, the name of one of the plant, or a number [SI].

    ``brings`` are parameters of the contact or of the plant that come with it. Raises :class:`ValueError` for a law
    that is of another kind than the port, or that is not given the numbers that it takes.
    """
    own = tuple(each for each in numbers.values() if isinstance(each, Parameter))
    named = tuple(
        (role, given.name if isinstance(given, Parameter) else given) for role, given in numbers.items()
    )
    return Effect(name, port, law, (*own, *brings), named, states, symptom, reference)


def families_of(effects: Sequence[Effect]) -> tuple[tuple[str, Family], ...]:
    """Where effects that act together are, and of which kind, each once.

    A number that is the linear part of a law beside it, as a tyre's rate of its stiffening, is one with it.
    """
    laws = {(each.port.location, each.law.family) for each in effects}
    wholes = ((each.port.location, each.linear_part_of, each.law.family) for each in effects)
    found = ((place, whole if (place, whole) in laws else family) for place, whole, family in wholes)
    return tuple(dict.fromkeys(found))


def typical_effect(
    name: str,
    port: Port,
    law: AbstractLaw,
    given: Mapping[str, str | float] | None = None,
    *,
    symptom: str = "",
    reference: str = "",
) -> Effect:
    """A law at a port with its typical numbers there.

    Parameters and states are named after the effect and their role. Roles that are ``given`` are a parameter of the
    plant, by name, or a number [SI] instead. Raises :class:`ValueError` as :func:`effect_at` does.
    """
    numbers: dict[str, Parameter | str | float] = {
        role: replace(each, name=f"{name}_{role}") if isinstance(each, Parameter) else each
        for role, each in law.typical(port).items()
    }
    numbers |= given or {}
    order = [role.name for role in law.roles]
    return effect_at(
        name,
        port,
        law,
        {role: numbers[role] for role in sorted(numbers, key=order.index)},
        states=tuple(f"{name}_{state.name}" for state in law.states(port)),
        symptom=symptom,
        reference=reference,
    )


LAWS: tuple[AbstractLaw, ...] = (
    Coulomb(),
    Preload(),
    Stribeck(),
    Breakaway(),
    Asymmetry(),
    PreslidingFriction(),
    SaturatingFriction(),
    Viscous(),
    AttachedOscillator(),
    OneSidedDamping(),
    LinearStiffness(),
    ProgressiveStiffness(),
    LowerStop(),
    UpperStop(),
    Compliance(),
    MassiveCompliance(),
    Backlash(),
    Resonance(),
    Offset(),
    Scale(),
    InputOffset(),
    InputScale(),
    InputHarmonics(),
    Gain(),
    Lag(),
    Delay(),
    Tilt(),
)
"""All laws."""


def generic_effects(ports: Iterable[Port]) -> Mapping[str, Effect]:
    """An effect for every law at every port that it suits, by name."""
    effects = [_effect(law, port, number) for law, port, number in _pairs(ports)]
    return MappingProxyType({effect.name: effect for effect in effects})


def _pairs(ports: Iterable[Port]) -> Iterator[tuple[AbstractLaw, Port, str]]:
    """Laws and ports that go together, and the name of the number at a number port."""
    for port in ports:
        for law in (law for law in LAWS if law.suits(port)):
            if port.kind is PortKind.NUMBER:
                for number in port.numbers:
                    yield law, replace(port, numbers=(number,)), number.name
            else:
                yield law, port, ""


def _effect(law: AbstractLaw, port: Port, number: str) -> Effect:
    name = "_".join(part for part in (port.name, number, law.name) if part)
    return typical_effect(
        name,
        port,
        law,
        {"number": number} if number else {},
        symptom=f"{law.family.value} at {port.location}",
        reference="the law's own",
    )
