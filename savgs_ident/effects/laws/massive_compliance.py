"""A spring and a damper in the path of a load, with a mass between them and the load: the belt of a tyre.

    F - F_0 = x / C + c xd + m xdd

with the deflection x [m], the load F [N], F_0 at rest, the compliance C [m/N], the damping c [N s/m] and the mass m
[kg]. With the mass the velocity behind the deflection is a state: without, a friction that depends on it would have
to be solved for, and full steps go to and fro between its two sides.

Source: Pacejka 2012, Tire and Vehicle Dynamics, on relaxation length.
"""

from collections.abc import Mapping
from math import pi
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


class MassiveCompliance(AbstractSeriesLaw):
    """Something with a mass that gives way in proportion to the load."""

    name: ClassVar[str] = "massive_compliance"
    words: ClassVar[str] = "something with a mass that gives way under the load"
    family: ClassVar[Family] = Family.COMPLIANCE
    roles: ClassVar[tuple[Role, ...]] = (Role("compliance", 0.0), Role("damping"), Role("mass"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical displacement under the typical load; damped to its half, at 200 Hz on a time scale of 1."""
        size, unit = port.displacement / port.force, per(port.displacement_unit, port.force_unit)
        omega = 400.0 * pi / port.time_scale
        return {
            "compliance": Parameter(
                "compliance", size, unit, lower=0.0, upper=100.0 * size, about="compliance"
            ),
            "damping": 1.0 / (omega * size),
            "mass": 1.0 / (omega**2 * size),
        }

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The deflection and its velocity."""
        unit = port.displacement_unit
        return (
            InternalState("deflection", unit, port.displacement),
            InternalState("velocity", f"{unit}/s", port.velocity),
        )

    def balance(
        self, v: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """Velocity [m/s] and deflection [m] out of balance."""
        compliance = v["compliance"]
        inertia = compliance * v["mass"] + SETTLING**2
        damping = compliance * v["damping"] + 2.0 * SETTLING
        velocity = state[1]
        bent = inertia * rate[1] + damping * velocity + state[0] - compliance * load.beyond_rest
        return jnp.stack([rate[0] - velocity, bent])
