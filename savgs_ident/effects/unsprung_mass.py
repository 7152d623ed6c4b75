"""An unsprung mass that is another than weighed, beyond its tolerance: another wheel, another brake.

    m_u -> m_u + dm

The upright with its wheel takes the change; the wishbones stay what they are, and so do all moments of
inertia.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractChange, InternalState, Port
from savgs_ident.model.values import Values


class UnsprungMass(AbstractChange):
    """Another mass of the wheel."""

    name: ClassVar[str] = "unsprung_mass"
    port: ClassVar[Port] = Port.INERTIA
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "unsprung_mass_change",
            8.0,
            "kg",
            lower=-20.0,
            upper=40.0,
            about="unsprung mass beyond the sheet's, at the upright",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"unsprung_mass_change": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the fast tests change, the slow ones do not: wheel hop moves"
    reference: ClassVar[str] = "Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5"

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The unsprung mass [kg]."""
        return {"m_u": p["m_u"] + p["unsprung_mass_change"]}
