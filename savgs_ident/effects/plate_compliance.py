"""Compliance of the road plate and of the cam's follower under the tyre's load.

    F_tz beyond the weight = x / C

with the compliance C [m/N]: the plate is lower by x than its encoder says, which was set with the rig on it.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSeries, InternalState, Load, Port, linear_series
from savgs_ident.model.values import Values


class PlateCompliance(AbstractSeries):
    """A plate that gives way under the tyre."""

    name: ClassVar[str] = "plate_compliance"
    port: ClassVar[Port] = Port.ROAD
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "plate_compliance", 5e-7, "m/N", lower=0.0, upper=1e-5, about="compliance of plate and follower"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"plate_compliance": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("plate_deflection", "m", 1e-3),)
    symptom: ClassVar[str] = "like a softer tyre without its damping; the body moves less than the plate says"
    reference: ClassVar[str] = "Koster 1974, Vibrations of Cam Mechanisms, on follower compliance"
    in_damper: ClassVar[bool] = False

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """By how much the plate is lower [m] under F_tz."""
        return linear_series(p["plate_compliance"], jnp.zeros_like(load.total), load, state, rate)
