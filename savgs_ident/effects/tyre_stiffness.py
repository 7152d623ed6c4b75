"""A tyre that is stiffer or softer than its sheet says, beyond its tolerance: pressure, load, age.

    k_t -> k_t (1 + e)

about the same free radius.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractChange, InternalState, Port
from savgs_ident.model.values import Values


class TyreStiffness(AbstractChange):
    """Another radial stiffness of the tyre."""

    name: ClassVar[str] = "tyre_stiffness"
    port: ClassVar[Port] = Port.TYRE_RADIAL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "tyre_stiffness_change",
            0.1,
            "1",
            lower=-0.6,
            upper=1.5,
            about="relative change of the tyre's stiffness",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"tyre_stiffness_change": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the body moves more or less above the resonance; below it hardly anything changes"
    )
    reference: ClassVar[str] = "Wong 2008, Theory of Ground Vehicles, ch. 1, ride properties of tyres"

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The tyre's radial stiffness [N/m]."""
        return {"k_t": p["k_t"] * (1.0 + p["tyre_stiffness_change"])}
