"""A spring, with a damper beside it, in the path of a load: a mount, a gear, a plate.

    F - F_0 = x / C + c xd

with the deflection x [m], the load F [N], F_0 at rest in the nominal state, the compliance C [m/N] and the damping c
[N s/m]. It is solved as x + T xd = C (F - F_0) with T = C c, at least the shortest time that the plant can follow,
which any compliance C >= 0 allows.

Source: Dixon 2007, The Shock Absorber Handbook, on mount bushes in series.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    SETTLING,
    AbstractSeriesLaw,
    Family,
    InternalState,
    Load,
    Port,
    Role,
    per,
)


class Compliance(AbstractSeriesLaw):
    """Something that gives way in proportion to the load."""

    name: ClassVar[str] = "compliance"
    words: ClassVar[str] = "something that gives way in proportion to the load"
    family: ClassVar[Family] = Family.COMPLIANCE
    roles: ClassVar[tuple[Role, ...]] = (Role("compliance", 0.0), Role("damping"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical displacement under the typical load, without damping."""
        size, unit = port.displacement / port.force, per(port.displacement_unit, port.force_unit)
        return {
            "compliance": Parameter(
                "compliance", size, unit, lower=0.0, upper=100.0 * size, about="compliance"
            ),
            "damping": 0.0,
        }

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The deflection."""
        return (InternalState("deflection", port.displacement_unit, port.displacement),)

    def balance(
        self, v: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The deflection out of balance [m or rad]."""
        time = jnp.sqrt((v["compliance"] * v["damping"]) ** 2 + SETTLING**2)
        return time * rate + state - v["compliance"] * load.beyond_rest
