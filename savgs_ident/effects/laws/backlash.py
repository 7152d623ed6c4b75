"""Backlash: what lies against one flank or the other, as its load says.

    x = b / 2 (tanh(F / F_s) - tanh(F_0 / F_s))

with the backlash b [m or rad], the load F [N or N m], F_0 at rest in the nominal state, and F_s, over which it
changes flanks.

Source: Nordin and Gutman 2002, Automatica 38(10), survey of backlash.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import SETTLING, AbstractSeriesLaw, Family, InternalState, Load, Port, Role


class Backlash(AbstractSeriesLaw):
    """Play in the path of a load."""

    name: ClassVar[str] = "backlash"
    words: ClassVar[str] = "play in the path of the load"
    family: ClassVar[Family] = Family.PLAY
    roles: ClassVar[tuple[Role, ...]] = (Role("backlash", 0.0), Role("change_over"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical displacement; it changes flanks within a fiftieth of the typical load."""
        size, unit = port.displacement, port.displacement_unit
        return {
            "backlash": Parameter("backlash", size, unit, lower=0.0, upper=20.0 * size, about="backlash"),
            "change_over": 0.02 * port.force,
        }

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The play that is taken."""
        return (InternalState("play", port.displacement_unit, port.displacement),)

    def balance(
        self, v: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The displacement off the flank that carries at rest, out of balance [m or rad]."""
        flank = jnp.tanh(load.total / v["change_over"]) - jnp.tanh(load.rest / v["change_over"])
        return SETTLING * rate + state - v["backlash"] / 2.0 * flank
