"""A cam that lifts more or less than its encoder says.

plate = (1 + e) recorded height
"""

from collections.abc import Mapping
from typing import ClassVar

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractRoadFault, Cam, InternalState, Port
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values


class CamScale(AbstractRoadFault):
    """A scale error of the plate's height."""

    name: ClassVar[str] = "cam_scale"
    port: ClassVar[Port] = Port.ROAD
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "cam_scale_change", 0.03, "1", lower=-0.5, upper=0.5, about="relative error of the cam's lift"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"cam_scale_change": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "both channels are too large or too small at every frequency, friction aside"
    reference: ClassVar[str] = "a gain error of the cam encoder, or an exchanged cam"

    def shift(self, p: Values, road: Road, cam: Cam) -> Road:
        """What the cam lifts beyond its encoder's reading."""
        return Road(p["cam_scale_change"] * road.height, p["cam_scale_change"] * road.velocity)
