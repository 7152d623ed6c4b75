"""A cam whose shape has higher orders that the road's channel does not show.

    dz = a_2 cos 2 phi + b_2 sin 2 phi + a_3 cos 3 phi + b_3 sin 3 phi

with phi [rad] the cam's angle, 0 where its first order is highest.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractRoadFault, Cam, InternalState, Port
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values


class CamHarmonic(AbstractRoadFault):
    """Second and third order of the cam's shape."""

    name: ClassVar[str] = "cam_harmonic"
    port: ClassVar[Port] = Port.ROAD
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("cam_cos_2", 2e-4, "m", lower=-0.01, upper=0.01, about="second order of the cam, cosine"),
        Parameter("cam_sin_2", 2e-4, "m", lower=-0.01, upper=0.01, about="second order of the cam, sine"),
        Parameter("cam_cos_3", 2e-4, "m", lower=-0.01, upper=0.01, about="third order of the cam, cosine"),
        Parameter("cam_sin_3", 2e-4, "m", lower=-0.01, upper=0.01, about="third order of the cam, sine"),
    )
    null: ClassVar[Mapping[str, float]] = {
        "cam_cos_2": 0.0,
        "cam_sin_2": 0.0,
        "cam_cos_3": 0.0,
        "cam_sin_3": 0.0,
    }
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = (
        "the second or third order of both channels is off in every test, in step with the cam"
    )
    reference: ClassVar[str] = "Norton 2009, Cam Design and Manufacturing Handbook, on profile errors"

    def shift(self, p: Values, road: Road, cam: Cam) -> Road:
        """What the cam lifts beyond its sine."""
        height, slope = jnp.zeros_like(cam.angle), jnp.zeros_like(cam.angle)
        for order in (2, 3):
            along, across = p[f"cam_cos_{order}"], p[f"cam_sin_{order}"]
            cosine, sine = jnp.cos(order * cam.angle), jnp.sin(order * cam.angle)
            height = height + along * cosine + across * sine
            slope = slope + order * (across * cosine - along * sine)
        return Road(height, slope * cam.speed)
