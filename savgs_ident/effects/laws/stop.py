"""A stop: a spring that only pushes, at the end of a gap.

    F = k max(0, x_0 - g - x)                 at the lower end of the travel
    F = -k max(0, x - x_0 - g)                at the upper end

with the port's displacement x [m], x_0 in the nominal state, the gap g [m] from there and the stiffness k [N/m].

Source: Milliken and Milliken 1995, Race Car Vehicle Dynamics, on bump stops.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role, per


def _typical(port: Port) -> Mapping[str, Parameter | float]:
    """A stop half the typical displacement away, with ten times the typical force after a tenth of it."""
    stiffness, unit = 100.0 * port.force / port.displacement, per(port.force_unit, port.displacement_unit)
    return {
        "stiffness": Parameter(
            "stiffness", stiffness, unit, lower=0.0, upper=100.0 * stiffness, about="stiffness of the stop"
        ),
        "gap": Parameter(
            "gap",
            0.5 * port.displacement,
            port.displacement_unit,
            lower=0.0,
            upper=5.0 * port.displacement,
            about="travel from the nominal state to the stop",
        ),
    }


class LowerStop(AbstractForceLaw):
    """A stop at the lower end of the travel: in bump, for a strut."""

    name: ClassVar[str] = "lower_stop"
    words: ClassVar[str] = "a stop at the lower end of the travel"
    family: ClassVar[Family] = Family.STOP
    roles: ClassVar[tuple[Role, ...]] = (Role("stiffness", 0.0), Role("gap"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A stop half the typical displacement away."""
        return _typical(port)

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The stop's push [N]."""
        contact = signals.rest - v["gap"]
        return v["stiffness"] * jnp.maximum(contact - signals.displacement, 0.0)


class UpperStop(AbstractForceLaw):
    """A stop at the upper end of the travel."""

    name: ClassVar[str] = "upper_stop"
    words: ClassVar[str] = "a stop at the upper end of the travel"
    family: ClassVar[Family] = Family.STOP
    roles: ClassVar[tuple[Role, ...]] = (Role("stiffness", 0.0), Role("gap"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A stop half the typical displacement away."""
        return _typical(port)

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The stop's push [N]."""
        contact = signals.rest + v["gap"]
        return -v["stiffness"] * jnp.maximum(signals.displacement - contact, 0.0)
