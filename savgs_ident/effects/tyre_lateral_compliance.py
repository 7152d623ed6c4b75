"""Lateral compliance of the tyre's carcass: the tread stays behind when the wheel scrubs sideways.

    force on the plate = x / C + c xd + m xdd

with the compliance C [m/N], and damping c [N s/m] and mass m [kg] of the belt. The friction of eq. (3) acts on the
belt, which starts to slide late.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import SETTLING, AbstractSeries, InternalState, Load, Port
from savgs_ident.model.values import Values

DAMPING = 1000.0
"""Damping of the belt against the rim [N s/m]."""

MASS = 5.0
"""Mass of the belt [kg]. With it the tread's velocity, on which the friction depends, is a state: without, the
friction would have to be solved for, and full steps go to and fro between its two sides."""


class TyreLateralCompliance(AbstractSeries):
    """A carcass that gives way sideways before the tread scrubs."""

    name: ClassVar[str] = "tyre_lateral_compliance"
    port: ClassVar[Port] = Port.TYRE_LATERAL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "tyre_lateral_compliance",
            2e-6,
            "m/N",
            lower=0.0,
            upper=1e-3,
            about="lateral compliance of the carcass",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"tyre_lateral_compliance": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (
        InternalState("carcass_deflection", "m", 1e-3),
        InternalState("carcass_velocity", "m/s", 1e-1),
    )
    symptom: ClassVar[str] = (
        "tyre friction sets in late after each reversal and acts like a spring at small motions"
    )
    reference: ClassVar[str] = "Pacejka 2012, Tire and Vehicle Dynamics, on relaxation length"
    in_damper: ClassVar[bool] = False

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """Velocity [m/s] and deflection [m] of the belt out of balance."""
        compliance = p["tyre_lateral_compliance"]
        inertia = compliance * MASS + SETTLING**2
        damping = compliance * DAMPING + 2.0 * SETTLING
        velocity = state[1]
        bent = inertia * rate[1] + damping * velocity + state[0] - compliance * load.beyond_rest
        return jnp.stack([rate[0] - velocity, bent])
