"""The registry of effects, and the rig models that are made of them.

To add an effect, write its file and name its class in ``CATALOGUE``.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig, merge_parameters
from savgs_ident.effects.accel_gain import AccelGain
from savgs_ident.effects.accel_lag import AccelLag
from savgs_ident.effects.accel_tilt import AccelTilt
from savgs_ident.effects.bump_stop import BumpStop
from savgs_ident.effects.bushing_stiffness import BushingStiffness
from savgs_ident.effects.cam_harmonic import CamHarmonic
from savgs_ident.effects.cam_scale import CamScale
from savgs_ident.effects.damper_hysteresis import DamperHysteresis
from savgs_ident.effects.damper_rebound_fade import DamperReboundFade
from savgs_ident.effects.damper_scale import DamperScale
from savgs_ident.effects.deflection_delay import DeflectionDelay
from savgs_ident.effects.deflection_gain import DeflectionGain
from savgs_ident.effects.frame_mode import FrameMode
from savgs_ident.effects.gear_backlash import GearBacklash
from savgs_ident.effects.gear_compliance import GearCompliance
from savgs_ident.effects.joint_friction import JointFriction
from savgs_ident.effects.learned.forces import (
    LearnedRail,
    LearnedStrut,
    LearnedSuspension,
    LearnedTyreLateral,
    LearnedTyreRadial,
)
from savgs_ident.effects.link_offset import LinkOffset
from savgs_ident.effects.mount_compliance import MountCompliance
from savgs_ident.effects.plate_compliance import PlateCompliance
from savgs_ident.effects.rail_asymmetry import RailAsymmetry
from savgs_ident.effects.rail_coulomb import RailCoulomb
from savgs_ident.effects.rail_preload import RailPreload
from savgs_ident.effects.rail_stribeck import RailStribeck
from savgs_ident.effects.rail_viscous import RailViscous
from savgs_ident.effects.spring_rate import SpringRate
from savgs_ident.effects.sprung_mass import SprungMass
from savgs_ident.effects.strut_friction import StrutFriction
from savgs_ident.effects.tyre_damping import TyreDamping
from savgs_ident.effects.tyre_friction import TyreFriction
from savgs_ident.effects.tyre_lateral_compliance import TyreLateralCompliance
from savgs_ident.effects.tyre_stiffening import TyreStiffening
from savgs_ident.effects.tyre_stiffness import TyreStiffness
from savgs_ident.effects.unsprung_mass import UnsprungMass
from savgs_ident.model.damper import damper_curve
from savgs_ident.model.effect import AbstractEffect
from savgs_ident.model.quarter_car import QuarterCar

CATALOGUE: Mapping[str, AbstractEffect] = MappingProxyType(
    {
        effect.name: effect
        for effect in (
            RailCoulomb(),
            RailPreload(),
            RailStribeck(),
            RailViscous(),
            RailAsymmetry(),
            JointFriction(),
            BushingStiffness(),
            StrutFriction(),
            MountCompliance(),
            SpringRate(),
            DamperScale(),
            DamperReboundFade(),
            DamperHysteresis(),
            BumpStop(),
            TyreFriction(),
            TyreStiffness(),
            TyreStiffening(),
            TyreDamping(),
            TyreLateralCompliance(),
            GearBacklash(),
            GearCompliance(),
            LinkOffset(),
            CamHarmonic(),
            CamScale(),
            PlateCompliance(),
            FrameMode(),
            SprungMass(),
            UnsprungMass(),
            AccelGain(),
            AccelLag(),
            AccelTilt(),
            DeflectionGain(),
            DeflectionDelay(),
        )
    }
)
"""All effects by name that a diagnosis looks for."""

LEARNED: Mapping[str, AbstractEffect] = MappingProxyType(
    {
        effect.name: effect
        for effect in (
            LearnedRail(), LearnedStrut(), LearnedSuspension(), LearnedTyreRadial(), LearnedTyreLateral()
        )
    }
)  # fmt: skip
"""Corrections by name that a diagnosis learns where it finds none of them."""

EFFECTS: Mapping[str, AbstractEffect] = MappingProxyType({**CATALOGUE, **LEARNED})
"""All that a model may have."""

MODELS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"simqc": (), "simtr": (RailCoulomb.name, TyreFriction.name)}
)
"""The paper's models by the effects they add to the frictionless rig."""


def build_model(rig: Rig, effects: Iterable[str]) -> QuarterCar:
    """The rig with the named effects added, in that order.

    Raises :class:`InputError` for a name that is neither in the catalogue nor a learned correction.
    """
    model = QuarterCar(damper_curve(rig))
    for name in effects:
        if name not in EFFECTS:
            raise InputError(
                f"there is no effect '{name}'", remedy="choose among: " + ", ".join(sorted(EFFECTS))
            )
        model = model + EFFECTS[name]
    return model


def model_parameters(rig: Rig, effects: Iterable[str]) -> ParameterTable:
    """The rig's parameters and those that the named effects bring along."""
    return merge_parameters(rig.parameters, *(ParameterTable(EFFECTS[name].parameters) for name in effects))
