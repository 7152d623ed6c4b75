"""A strut spring that is stiffer or softer than its sheet says, beyond its tolerance.

    k_sd -> k_sd (1 + e)

about the same free length.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractChange, InternalState, Port
from savgs_ident.model.values import Values


class SpringRate(AbstractChange):
    """Another rate of the strut's spring."""

    name: ClassVar[str] = "spring_rate"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "spring_rate_change", 0.05, "1", lower=-0.6, upper=1.5, about="relative change of the spring rate"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"spring_rate_change": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the resonance moves, its damping hardly changes"
    reference: ClassVar[str] = "Gillespie 1992, Fundamentals of Vehicle Dynamics, ch. 5"

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The spring's rate [N/m]."""
        return {"k_sd": p["k_sd"] * (1.0 + p["spring_rate_change"])}
