"""Backlash of the link's gear: the link lies against one flank or the other.

    x = b / 2 (tanh(T / T_0) - tanh(T_r / T_0))

with the backlash b [rad] at the link, the torque T [N m], T_r that at rest in the nominal state, and T_0 = 1 N m,
over which it changes flanks. The strut's load keeps the gear against one flank, and where it lets go, with the
link near 0 or 180 deg, it has no lever: passive tests show nothing of it. It shows where a strut that is pulled
turns the torque round, and where a drive takes the link through 0 or 180 deg.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import SETTLING, AbstractSeries, InternalState, Load, Port
from savgs_ident.model.values import Values

CHANGE_OVER = 1.0
"""Torque within which the link changes flanks [N m]: small beside the tens of N m of the strut."""


class GearBacklash(AbstractSeries):
    """Play of the link's gear."""

    name: ClassVar[str] = "gear_backlash"
    port: ClassVar[Port] = Port.LINK
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "gear_backlash", 0.01, "rad", lower=0.0, upper=0.2, about="backlash of the gear, at the link"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"gear_backlash": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("gear_play", "rad", 1e-2),)
    symptom: ClassVar[str] = (
        "the link knocks where its torque changes sign; where it does not, its angle is off by a constant"
    )
    reference: ClassVar[str] = "Nordin and Gutman 2002, Automatica 38(10), survey of backlash"
    in_damper: ClassVar[bool] = False

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The way [rad] off the flank that carries at rest, under the torque to greater angles."""
        flank = jnp.tanh(load.total / CHANGE_OVER) - jnp.tanh(load.rest / CHANGE_OVER)
        return SETTLING * rate + state - p["gear_backlash"] / 2.0 * flank
