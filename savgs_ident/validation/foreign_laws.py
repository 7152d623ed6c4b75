"""Foreign laws: effects that follow formulas which the diagnosis does not have.

    drawn = FOREIGN["tyre_cubic"]
    drawn.effect            # the law at its port, as in the catalogue
    drawn.ports             # where an engineer would rightly put it
    drawn.families          # what kind of thing an engineer would rightly call it

Truth and diagnosis share neither formula nor typical sizes. The laws are in
:mod:`savgs_ident.validation.foreign_frictions` (friction), :mod:`savgs_ident.validation.foreign_forces` (springs,
dampers, contacts, attached masses) and :mod:`savgs_ident.validation.foreign_signals` (sensors, inputs).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from savgs_ident.core.parameter import Parameter
from savgs_ident.effects.base import AbstractLaw, Family, Port
from savgs_ident.effects.effect import Effect, effect_at
from savgs_ident.plants.quarter_car.ports import (
    ACCEL,
    DAMPER,
    DEFLECTION,
    RAIL,
    ROAD,
    STRUT,
    SUSPENSION,
    TYRE_RADIAL,
)
from savgs_ident.validation.foreign_forces import (
    AttachedOscillator,
    Clearance,
    CubicStiffness,
    DigressiveDamping,
    EndPlay,
    ExponentialStiffness,
    ExponentialStop,
    HardeningOscillator,
    QuadraticDrag,
)
from savgs_ident.validation.foreign_frictions import (
    BoucWen,
    Dahl,
    DirectionalFriction,
    ExponentialStribeck,
    LuGre,
    SmoothFriction,
)
from savgs_ident.validation.foreign_signals import CamWaves, HighPass, SecondOrderFilter


@dataclass(frozen=True)
class ForeignEffect:
    """An effect that no catalogue has, and what counts as the right answer.

    Attributes:
        effect: the law at its port.
        ports: locations that are right.
        families: families that are right.
    """

    effect: Effect
    ports: tuple[str, ...]
    families: tuple[str, ...]


def _foreign(
    name: str,
    law: AbstractLaw,
    port: Port,
    *families: Family,
    ports: tuple[str, ...] = (),
    named: Mapping[str, str] | None = None,
) -> ForeignEffect:
    """A law at a port with its typical sizes there; ``named`` are roles that are parameters of the plant.

    Right are the port's location and the law's family, or those given.
    """
    numbers: dict[str, Parameter | str | float] = {}
    for role, given in law.typical(port).items():
        numbers[role] = replace(given, name=f"{name}_{role}") if isinstance(given, Parameter) else given
    states = tuple(f"{name}_{state.name}" for state in law.states(port))
    numbers |= named or {}
    effect = effect_at(name, port, law, numbers, states=states, symptom=law.name, reference="the law's own")
    accepted = families or (law.family,)
    return ForeignEffect(effect, ports or (port.location,), tuple(family.value for family in accepted))


_BODY = ("rail", "inertia", "frame")
"""Where something that swings on the sprung mass may rightly be put: its force acts on the body along the rail."""

_PROGRESSIVE = (Family.STIFFNESS, Family.STOP)
"""A spring that is soft and then steep is rightly called either."""

_ENTRIES = (
    _foreign("rail_exponential_stribeck", ExponentialStribeck(), RAIL, named={"coefficient": "mu_r"}),
    _foreign("rail_dahl", Dahl(), RAIL),
    _foreign("rail_lugre", LuGre(), RAIL),
    _foreign("rail_smooth", SmoothFriction(), RAIL),
    _foreign("rail_directional", DirectionalFriction(), RAIL),
    _foreign("rail_drag", QuadraticDrag(), RAIL),
    _foreign("body_oscillator", AttachedOscillator(), RAIL, ports=_BODY),
    _foreign("body_hardening_oscillator", HardeningOscillator(), RAIL, ports=_BODY),
    _foreign("joint_dahl", Dahl(), SUSPENSION),
    _foreign("joint_lugre", LuGre(), SUSPENSION),
    _foreign("joint_bouc_wen", BoucWen(), SUSPENSION),
    _foreign("joint_smooth", SmoothFriction(), SUSPENSION),
    _foreign("joint_directional", DirectionalFriction(), SUSPENSION),
    _foreign("joint_cubic", CubicStiffness(), SUSPENSION),
    _foreign("joint_exponential", ExponentialStiffness(), SUSPENSION, *_PROGRESSIVE),
    _foreign("joint_digressive", DigressiveDamping(), SUSPENSION),
    _foreign("joint_clearance", Clearance(), SUSPENSION, Family.STOP, Family.PLAY),
    _foreign("strut_bouc_wen", BoucWen(), STRUT),
    _foreign("strut_smooth", SmoothFriction(), STRUT),
    _foreign("strut_cubic", CubicStiffness(), STRUT),
    _foreign("strut_buffer", ExponentialStop(), STRUT, Family.STOP, Family.STIFFNESS),
    _foreign("strut_drag", QuadraticDrag(), STRUT),
    _foreign("strut_digressive", DigressiveDamping(), STRUT),
    _foreign("strut_clearance", Clearance(), STRUT, Family.STOP, Family.PLAY),
    _foreign("damper_end_play", EndPlay(), DAMPER),
    _foreign("tyre_cubic", CubicStiffness(from_rest=False), TYRE_RADIAL),
    _foreign("tyre_exponential", ExponentialStiffness(from_rest=False), TYRE_RADIAL),
    _foreign("accel_second_order", SecondOrderFilter(), ACCEL),
    _foreign("accel_high_pass", HighPass(), ACCEL),
    _foreign("deflection_second_order", SecondOrderFilter(), DEFLECTION),
    _foreign("deflection_high_pass", HighPass(), DEFLECTION),
    _foreign("cam_waves", CamWaves(), ROAD),
)

FOREIGN: Mapping[str, ForeignEffect] = MappingProxyType({each.effect.name: each for each in _ENTRIES})
"""All foreign effects by name."""


def foreign_laws() -> Mapping[str, tuple[str, ...]]:
    """The names of the foreign effects by the name of their law."""
    found: dict[str, tuple[str, ...]] = {}
    for name, each in FOREIGN.items():
        law = each.effect.law.name
        found[law] = (*found.get(law, ()), name)
    return found
