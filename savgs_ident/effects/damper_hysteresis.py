"""Hysteresis of the damper: a spring at its end, of oil, gas and rubber bushes.

    push of the damper = x / C

with the compliance C [m/N]. The damper's force then lags behind the strut's velocity and forms a loop over
it.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSeries, InternalState, Load, Port, linear_series
from savgs_ident.model.values import Values


class DamperHysteresis(AbstractSeries):
    """A damper that gives way before it moves."""

    name: ClassVar[str] = "damper_hysteresis"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "damper_compliance",
            5e-7,
            "m/N",
            lower=0.0,
            upper=1e-4,
            about="compliance in series with the damper",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"damper_compliance": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("damper_deflection", "m", 1e-3),)
    symptom: ClassVar[str] = (
        "the damper acts less and stiffens the suspension, the more so the faster it moves"
    )
    reference: ClassVar[str] = "Duym 2000, Vehicle System Dynamics 33(4), on shock absorber models"
    in_damper: ClassVar[bool] = True

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The deflection [m] under the damper's push."""
        return linear_series(p["damper_compliance"], jnp.zeros_like(load.total), load, state, rate)
