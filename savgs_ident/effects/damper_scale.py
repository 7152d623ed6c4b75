"""A damper that is harder or softer than its sheet says, beyond its tolerance.

    c_sd -> c_sd (1 + e)

which scales the whole table as one.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractChange, InternalState, Port
from savgs_ident.model.values import Values


class DamperScale(AbstractChange):
    """Another damping of the strut."""

    name: ClassVar[str] = "damper_scale"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "damper_scale_change", 0.1, "1", lower=-0.95, upper=3.0, about="relative change of the damping"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"damper_scale_change": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the resonance is sharper or blunter at the same frequency"
    reference: ClassVar[str] = "Dixon 2007, The Shock Absorber Handbook, on tolerances and temperature"

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The strut's linearised damping [N s/m]."""
        return {"c_sd": p["c_sd"] * (1.0 + p["damper_scale_change"])}
