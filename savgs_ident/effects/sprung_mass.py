"""A sprung mass that is another than weighed, beyond its tolerance: a payload on the rail's line.

    m_s -> m_s + dm

with its weight, under which the rig stands lower.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractChange, InternalState, Port
from savgs_ident.model.values import Values


class SprungMass(AbstractChange):
    """A payload of the sprung mass."""

    name: ClassVar[str] = "sprung_mass"
    port: ClassVar[Port] = Port.INERTIA
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "sprung_mass_change",
            15.0,
            "kg",
            lower=-100.0,
            upper=200.0,
            about="sprung mass beyond the sheet's",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"sprung_mass_change": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the resonance moves and the rig stands lower or higher; wheel hop does not change"
    )
    reference: ClassVar[str] = "Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5"

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The sprung mass [kg]."""
        return {"m_s": p["m_s"] + p["sprung_mass_change"]}
