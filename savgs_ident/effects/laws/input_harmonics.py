"""An input with higher orders of its fundamental that its recording does not show: the shape of a cam.

    du = a_2 cos 2 phi + b_2 sin 2 phi + a_3 cos 3 phi + b_3 sin 3 phi

with phi [rad] the angle of the fundamental, 0 where it is highest, and the amplitudes in the unit of the input.

Source: Norton 2009, Cam Design and Manufacturing Handbook, on profile errors.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractInputLaw, Family, Fundamental, InputSignal, Port, Role

ORDERS = (2, 3)


class InputHarmonics(AbstractInputLaw):
    """Second and third order of an input."""

    name: ClassVar[str] = "harmonics"
    words: ClassVar[str] = "waves of second and third order on the input"
    family: ClassVar[Family] = Family.SHAPE
    roles: ClassVar[tuple[Role, ...]] = tuple(
        Role(f"{wave}_{order}", 0.0) for order in ORDERS for wave in ("cos", "sin")
    )

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Two hundredths of the typical displacement each."""
        size, unit = 0.02 * port.displacement, port.displacement_unit
        return {
            role.name: Parameter(
                role.name, size, unit, lower=-50.0 * size, upper=50.0 * size, about=f"amplitude {role.name}"
            )
            for role in self.roles
        }

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """What the higher orders add."""
        value, slope = jnp.zeros_like(fundamental.angle), jnp.zeros_like(fundamental.angle)
        for order in ORDERS:
            along, across = v[f"cos_{order}"], v[f"sin_{order}"]
            cosine, sine = jnp.cos(order * fundamental.angle), jnp.sin(order * fundamental.angle)
            value = value + along * cosine + across * sine
            slope = slope + order * (across * cosine - along * sine)
        return InputSignal(value, slope * fundamental.speed)
