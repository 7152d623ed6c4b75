"""A spring in series at any port, without parameters of its own."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSeriesLaw, Family, InternalState, Load, Port, PortKind, Role
from savgs_ident.effects.effect import Effect, effect_at
from savgs_ident.plants.quarter_car.ports import PORTS

SERIES_PORTS = tuple(port for port in PORTS if port.kind is PortKind.SERIES)
"""Where something may give way."""


class _Spring(AbstractSeriesLaw):
    """A spring of a compliance [m/N or rad/(N m)], with nothing beside it."""

    name: ClassVar[str] = "yielding"
    family: ClassVar[Family] = Family.COMPLIANCE
    roles: ClassVar[tuple[Role, ...]] = ()
    compliance: float = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        return {}

    def states(self, port: Port) -> tuple[InternalState, ...]:
        return (InternalState("deflection", "m", 1e-3),)

    def balance(self, v: Values, load: Load, state: Array, rate: Array) -> Array:
        return state - self.compliance * load.beyond_rest


def yielding(port: Port, compliance: float = 0.0, name: str = "yielding") -> Effect:
    """The spring at a port."""
    return effect_at(name, port, _Spring(compliance), {})
