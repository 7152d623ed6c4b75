"""A tilted accelerometer sees the cosine of its tilt, as if its gain were too low."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import build_model

from ..model.instants import as_values

FREQUENCY = np.array([0.0, 0.5, 60.0])


@pytest.mark.parametrize("degrees", [0.0, 14.0, 60.0])
def test_it_sees_the_vertical_through_its_tilt(rig: Rig, numbers: dict[str, float], degrees: float) -> None:
    """The share of a vertical vector along a tilted axis."""
    tilt = np.radians(degrees)
    axis, up = np.array([np.sin(tilt), np.cos(tilt)]), np.array([0.0, 1.0])
    p = as_values(numbers | {"accel_tilt_versine": 2.0 * np.sin(tilt / 2.0) ** 2})
    accel, deflection = build_model(rig, ("accel_tilt",)).transfers(p, jnp.asarray(FREQUENCY))
    np.testing.assert_allclose(accel, axis @ up, rtol=1e-14)
    assert np.all(np.asarray(deflection) == 1.0)


def test_nothing_tells_it_from_a_gain_below_one(rig: Rig, numbers: dict[str, float]) -> None:
    p = as_values(numbers | {"accel_tilt_versine": 0.03, "accel_gain_error": -0.03})
    tilt, gain = (
        build_model(rig, (name,)).transfers(p, jnp.asarray(FREQUENCY))
        for name in ("accel_tilt", "accel_gain")
    )
    assert np.array_equal(np.asarray(tilt), np.asarray(gain))
