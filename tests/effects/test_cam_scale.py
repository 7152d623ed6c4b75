"""A cam that lifts more than its encoder says."""

import jax.numpy as jnp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.effects.cam_scale import CamScale
from savgs_ident.model.effect import Cam
from savgs_ident.model.tyre import Road

from .laws import typical

SCALE = CamScale()


@given(
    height=st.floats(-0.02, 0.02),
    velocity=st.floats(-0.5, 0.5),
    error=st.floats(-0.5, 0.5),
    angle=st.floats(0.0, 6.0),
)
def test_what_the_plate_does_is_in_proportion_to_what_is_recorded(
    height: float, velocity: float, error: float, angle: float
) -> None:
    """Height and velocity alike, whatever the cam's angle."""
    road, cam = Road(jnp.asarray(height), jnp.asarray(velocity)), Cam(jnp.asarray(angle), jnp.asarray(10.0))
    shift = SCALE.shift(typical(SCALE, cam_scale_change=error), road, cam)
    assert height + float(shift.height) == pytest.approx((1.0 + error) * height, rel=1e-12, abs=1e-15)
    assert velocity + float(shift.velocity) == pytest.approx((1.0 + error) * velocity, rel=1e-12, abs=1e-15)
