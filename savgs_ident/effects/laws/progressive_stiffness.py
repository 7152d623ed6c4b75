"""A spring that stiffens as it is deflected.

    F = -k s x |x|

with the port's displacement x [m], a stiffness k [N/m] and the relative rise s [1/m] of the secant stiffness.
Together with a spring k the tangent stays positive while 1 + 2 s |x| > 0. The displacement counts from the nominal
state, or, where it is the whole deflection of the spring as a tyre's compression, from zero.

Source: Pacejka 2012, Tire and Vehicle Dynamics, ch. 4, vertical load against deflection.
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role, per


class ProgressiveStiffness(AbstractForceLaw):
    """A force against the displacement that grows with its square.

    ``from_rest``: whether the displacement counts from the nominal state.
    """

    name: ClassVar[str] = "stiffening"
    words: ClassVar[str] = "a stiffness that grows with the displacement"
    family: ClassVar[Family] = Family.STIFFNESS
    roles: ClassVar[tuple[Role, ...]] = (Role("stiffness"), Role("rise", 0.0))
    from_rest: bool = eqx.field(static=True, default=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force at the typical displacement."""
        rise = 1.0 / port.displacement
        about = "rise of the secant stiffness per displacement"
        return {
            "stiffness": port.force / port.displacement,
            "rise": Parameter(
                "rise", rise, per("1", port.displacement_unit), lower=-rise, upper=100.0 * rise, about=about
            ),
        }

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The force on top of that of a linear spring [N]."""
        x = signals.displacement - signals.rest if self.from_rest else signals.displacement
        return -(v["stiffness"] * v["rise"] * x * jnp.abs(x))
