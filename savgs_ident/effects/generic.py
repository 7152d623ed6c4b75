"""Effects for plants without a catalogue: every law at every port that it suits, with typical sizes from the port.

    effects = generic_effects(plant.ports)

An effect is named after its port and its law: ``suspension_viscous``. At a number port there is one for each number:
``inertia_m_s_offset``.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

from savgs_ident.core.parameter import Parameter
from savgs_ident.effects.base import AbstractLaw, Port, PortKind
from savgs_ident.effects.effect import Effect, effect_at
from savgs_ident.effects.laws.asymmetry import Asymmetry
from savgs_ident.effects.laws.attached_oscillator import AttachedOscillator
from savgs_ident.effects.laws.backlash import Backlash
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

LAWS: tuple[AbstractLaw, ...] = (
    Coulomb(),
    Preload(),
    Stribeck(),
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
    numbers: dict[str, Parameter | str | float] = {"number": number} if number else {}
    for role, given in law.typical(port).items():
        numbers[role] = replace(given, name=f"{name}_{role}") if isinstance(given, Parameter) else given
    states = tuple(f"{name}_{state.name}" for state in law.states(port))
    return effect_at(
        name,
        port,
        law,
        numbers,
        states=states,
        symptom=f"{law.family.value} at {port.location}",
        reference="the law's own",
    )
