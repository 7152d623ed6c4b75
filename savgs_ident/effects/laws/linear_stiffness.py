"""A linear spring beside what the plant has.

    F = -k (x - x_0)

with the stiffness k [N/m] and the port's displacement x [m], x_0 in the nominal state, where it is unstrained.

Source: Blundell and Harty 2004, The Multibody Systems Approach to Vehicle Dynamics, on bushes.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role, per


class LinearStiffness(AbstractForceLaw):
    """A force against the displacement and in proportion to it."""

    name: ClassVar[str] = "stiffness"
    words: ClassVar[str] = "a stiffness in proportion to the displacement"
    family: ClassVar[Family] = Family.STIFFNESS
    roles: ClassVar[tuple[Role, ...]] = (Role("stiffness", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A stiffness of the typical force at the typical displacement."""
        size, unit = port.force / port.displacement, per(port.force_unit, port.displacement_unit)
        stiffness = Parameter(
            "stiffness", size, unit, lower=-100.0 * size, upper=100.0 * size, about="stiffness"
        )
        return {"stiffness": stiffness}

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The spring's force [N]."""
        return -v["stiffness"] * (signals.displacement - signals.rest)
