"""Compliance of the link's gear: a torsion spring between the drive and the link.

    torque beyond that at rest = x / C

with the compliance C [rad/(N m)]. The link's angle was set with the rig standing on it.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSeries, InternalState, Load, Port, linear_series
from savgs_ident.model.values import Values


class GearCompliance(AbstractSeries):
    """A gear that gives way under the strut's torque."""

    name: ClassVar[str] = "gear_compliance"
    port: ClassVar[Port] = Port.LINK
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "gear_compliance",
            1e-3,
            "rad/(N m)",
            lower=0.0,
            upper=1e-2,
            about="torsional compliance of gear and link",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"gear_compliance": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("gear_windup", "rad", 1e-2),)
    symptom: ClassVar[str] = (
        "the suspension is softer where the link stands across the strut, and not where it is in line"
    )
    reference: ClassVar[str] = (
        "Spong 1987, Journal of Dynamic Systems, Measurement, and Control 109(4), on elastic joints"
    )
    in_damper: ClassVar[bool] = False

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The wind-up [rad] under the torque to greater angles."""
        return linear_series(p["gear_compliance"], jnp.zeros_like(load.total), load, state, rate)
