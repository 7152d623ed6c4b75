"""Lateral compliance of the tyre's carcass: the tread stays behind when the wheel scrubs sideways.

    force on the plate = x / C + c xd

with the compliance C [m/N] and a little damping c [N s/m] of the rubber. The friction of eq. (3) sees the
tread, which starts to slide late.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSeries, InternalState, Load, Port, linear_series
from savgs_ident.model.values import Values

DAMPING = 1000.0
"""Damping of the carcass [N s/m]: a tenth or less of what the tread's friction has before it slides. Without
it a tread that is about to slide is hard to solve for.
"""


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
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("carcass_deflection", "m", 1e-3),)
    symptom: ClassVar[str] = (
        "tyre friction sets in late after each reversal and acts like a spring at small motions"
    )
    reference: ClassVar[str] = "Pacejka 2012, Tire and Vehicle Dynamics, on relaxation length"
    in_damper: ClassVar[bool] = False

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The carcass's deflection [m] under the lateral force."""
        return linear_series(
            p["tyre_lateral_compliance"], DAMPING * jnp.ones_like(load.total), load, state, rate
        )
