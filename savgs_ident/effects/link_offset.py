"""Zero error of the link's encoder.

    theta_0 -> theta_0 + e

The encoder counts from where it takes link and strut to be in line; the crank is e [rad] further on than it
reads.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractChange, InternalState, Port
from savgs_ident.model.values import Values


class LinkOffset(AbstractChange):
    """A link that stands at another angle than its encoder says."""

    name: ClassVar[str] = "link_offset"
    port: ClassVar[Port] = Port.LINK
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "link_offset",
            0.2,
            "rad",
            lower=-0.5,
            upper=0.5,
            about="true angle of the link less the one of its encoder",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"link_offset": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "passive tests at 90 deg hardly change; away from it the leverage of the link is off"
    )
    reference: ClassVar[str] = (
        "Mooring, Roth, Driels 1991, Fundamentals of Manipulator Calibration, on joint offsets"
    )

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The crank's angle at a reading of zero [rad]."""
        return {"theta_0": p["theta_0"] + p["link_offset"]}
