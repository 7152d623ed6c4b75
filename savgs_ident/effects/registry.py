"""The registry of effects, and the rig models that are made of them.

To add an effect, write its file and name its class in ``CATALOGUE``.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig, merge_parameters
from savgs_ident.effects.accel_lag import AccelLag
from savgs_ident.effects.cam_scale import CamScale
from savgs_ident.effects.mount_compliance import MountCompliance
from savgs_ident.effects.rail_coulomb import RailCoulomb
from savgs_ident.effects.rail_stribeck import RailStribeck
from savgs_ident.effects.spring_rate import SpringRate
from savgs_ident.effects.tyre_friction import TyreFriction
from savgs_ident.model.damper import damper_curve
from savgs_ident.model.effect import AbstractEffect
from savgs_ident.model.quarter_car import QuarterCar

CATALOGUE: Mapping[str, AbstractEffect] = MappingProxyType(
    {
        effect.name: effect
        for effect in (
            RailCoulomb(),
            RailStribeck(),
            MountCompliance(),
            SpringRate(),
            TyreFriction(),
            CamScale(),
            AccelLag(),
        )
    }
)
"""All effects by name."""

MODELS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"simqc": (), "simtr": (RailCoulomb.name, TyreFriction.name)}
)
"""The paper's models by the effects they add to the frictionless rig."""


def build_model(rig: Rig, effects: Iterable[str]) -> QuarterCar:
    """The rig with the named effects added, in that order.

    Raises :class:`InputError` for a name that is not in the catalogue.
    """
    model = QuarterCar(damper_curve(rig))
    for name in effects:
        if name not in CATALOGUE:
            raise InputError(
                f"there is no effect '{name}'", remedy="choose among: " + ", ".join(sorted(CATALOGUE))
            )
        model = model + CATALOGUE[name]
    return model


def model_parameters(rig: Rig, effects: Iterable[str]) -> ParameterTable:
    """The rig's parameters and those that the named effects bring along."""
    return merge_parameters(rig.parameters, *(ParameterTable(CATALOGUE[name].parameters) for name in effects))
