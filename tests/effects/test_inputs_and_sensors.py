"""A road that is not what its encoder says, and sensors that show other than what is there."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.effects.base import Fundamental, InputSignal
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, build_model
from savgs_ident.plants.quarter_car.rig import Rig

from ..plants.quarter_car.instants import as_values
from .laws import typical

# cam_harmonic: a cam with a second and a third order, and no other.

CAM = CATALOGUE["cam_harmonic"]
HARMONICS_P = typical(CAM, cam_cos_2=3e-4, cam_sin_2=-1e-4, cam_cos_3=-2e-4, cam_sin_3=5e-5)
HARMONICS_NODES = 32
HARMONICS_ANGLE = 2.0 * np.pi * np.arange(HARMONICS_NODES) / HARMONICS_NODES
HARMONICS_SPEED = 2.0 * np.pi * 2.35


def _turned() -> InputSignal:
    still = jnp.zeros(HARMONICS_NODES)
    return CAM.shift(
        HARMONICS_P,
        InputSignal(still, still),
        Fundamental(jnp.asarray(HARMONICS_ANGLE), jnp.full(HARMONICS_NODES, HARMONICS_SPEED)),
    )


def test_its_orders_have_the_amplitudes_that_its_parameters_say() -> None:
    """a_n - i b_n where the first order is a cosine; so its phase to the cam is fixed, whatever the frequency."""
    orders = 2.0 * np.fft.rfft(np.asarray(_turned().value)) / HARMONICS_NODES
    expected = np.zeros(HARMONICS_NODES // 2 + 1, complex)
    expected[2], expected[3] = 3e-4 + 1e-4j, -2e-4 - 5e-5j
    np.testing.assert_allclose(orders, expected, atol=1e-18)


def test_its_velocity_is_the_derivative_of_its_height() -> None:
    road = _turned()
    orders = np.fft.rfft(np.asarray(road.value)) * 1j * np.arange(HARMONICS_NODES // 2 + 1) * HARMONICS_SPEED
    np.testing.assert_allclose(np.asarray(road.rate), np.fft.irfft(orders, HARMONICS_NODES), atol=1e-14)


def test_a_cam_that_stands_does_not_move_the_plate() -> None:
    still = jnp.zeros(HARMONICS_NODES)
    assert not np.any(
        np.asarray(
            CAM.shift(
                HARMONICS_P, InputSignal(still, still), Fundamental(jnp.asarray(HARMONICS_ANGLE), still)
            ).rate
        )
    )


# cam_scale: a cam that lifts more than its encoder says.

SCALE = CATALOGUE["cam_scale"]


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
    road, cam = (
        InputSignal(jnp.asarray(height), jnp.asarray(velocity)),
        Fundamental(jnp.asarray(angle), jnp.asarray(10.0)),
    )
    shift = SCALE.shift(typical(SCALE, cam_scale_change=error), road, cam)
    assert height + float(shift.value) == pytest.approx((1.0 + error) * height, rel=1e-12, abs=1e-15)
    assert velocity + float(shift.rate) == pytest.approx((1.0 + error) * velocity, rel=1e-12, abs=1e-15)


# accel_gain: a gain error shows at every frequency alike, and on the acceleration alone.


@pytest.mark.parametrize("error", [-0.3, 0.05])
def test_it_multiplies_the_acceleration_alone(rig: Rig, numbers: dict[str, float], error: float) -> None:
    p = as_values(numbers | {"accel_gain_error": error})
    accel, deflection = build_model(rig, ("accel_gain",)).transfers(p, jnp.asarray([0.0, 0.5, 60.0]))
    np.testing.assert_allclose(accel, 1.0 + error, rtol=1e-15)
    assert np.all(np.asarray(deflection) == 1.0)


# accel_lag: a first-order lag: its corner, and its delay far below it.

LAG = CATALOGUE["accel_lag"]


@pytest.mark.parametrize("time", [2e-3, 0.05])
def test_at_its_corner_it_is_down_by_the_square_root_of_two_and_45_degrees_late(time: float) -> None:
    corner = 1.0 / (2.0 * np.pi * time)
    seen = complex(LAG.transfer(typical(LAG, accel_lag_time=time), jnp.asarray([corner]))[0])
    assert abs(seen) == pytest.approx(1.0 / np.sqrt(2.0), rel=1e-12)
    assert np.degrees(np.angle(seen)) == pytest.approx(-45.0, rel=1e-12)


def test_far_below_its_corner_it_is_a_delay_and_far_above_an_integrator() -> None:
    p = typical(LAG, accel_lag_time=0.01)
    still, slow, fast = np.asarray(LAG.transfer(p, jnp.asarray([0.0, 1e-3, 1e5])))
    assert still == 1.0
    assert -np.angle(slow) / (2.0 * np.pi * 1e-3) == pytest.approx(0.01, rel=1e-6)
    assert fast == pytest.approx(1.0 / (2j * np.pi * 1e5 * 0.01), rel=1e-3)


def test_a_step_comes_through_with_its_time_constant() -> None:
    """The response to an impulse is exp(-t / tau) / tau: its transform, summed up by brute force."""
    time, step = 0.02, 2e-5
    t = step * (np.arange(20_000) + 0.5)
    impulse = np.exp(-t / time) / time
    for frequency in (1.0, 8.0):
        expected = np.sum(impulse * np.exp(-2j * np.pi * frequency * t)) * step
        seen = LAG.transfer(typical(LAG, accel_lag_time=time), jnp.asarray([frequency]))[0]
        assert complex(seen) == pytest.approx(expected, rel=1e-5)


# accel_tilt: a tilted accelerometer sees the cosine of its tilt, as if its gain were too low.

TILT_FREQUENCY = np.array([0.0, 0.5, 60.0])


@pytest.mark.parametrize("degrees", [0.0, 14.0, 60.0])
def test_it_sees_the_vertical_through_its_tilt(rig: Rig, numbers: dict[str, float], degrees: float) -> None:
    """The share of a vertical vector along a tilted axis."""
    tilt = np.radians(degrees)
    axis, up = np.array([np.sin(tilt), np.cos(tilt)]), np.array([0.0, 1.0])
    p = as_values(numbers | {"accel_tilt_versine": 2.0 * np.sin(tilt / 2.0) ** 2})
    accel, deflection = build_model(rig, ("accel_tilt",)).transfers(p, jnp.asarray(TILT_FREQUENCY))
    np.testing.assert_allclose(accel, axis @ up, rtol=1e-14)
    assert np.all(np.asarray(deflection) == 1.0)


def test_nothing_distinguishes_it_from_a_gain_below_one(rig: Rig, numbers: dict[str, float]) -> None:
    p = as_values(numbers | {"accel_tilt_versine": 0.03, "accel_gain_error": -0.03})
    tilt, gain = (
        build_model(rig, (name,)).transfers(p, jnp.asarray(TILT_FREQUENCY))
        for name in ("accel_tilt", "accel_gain")
    )
    assert np.array_equal(np.asarray(tilt), np.asarray(gain))


# deflection_delay: a delay: every frequency late by the same time, none smaller.

DELAY = CATALOGUE["deflection_delay"]


@given(delay=st.floats(0.0, 0.2), base=st.floats(0.5, 6.0), seed=st.integers(0, 100))
def test_a_waveform_comes_late_and_unchanged(delay: float, base: float, seed: int) -> None:
    """Any sum of orders, at any instant."""
    rng = np.random.default_rng(seed)
    frequency = base * np.arange(6)
    waves = rng.standard_normal(6) + 1j * rng.standard_normal(6)
    shown = waves * np.asarray(
        DELAY.transfer(typical(DELAY, deflection_delay_time=delay), jnp.asarray(frequency))
    )

    def at(amplitudes: np.ndarray, t: np.ndarray) -> np.ndarray:
        return np.sum(amplitudes * np.exp(2j * np.pi * frequency * t[:, None]), axis=1).real

    t = rng.uniform(0.0, 1.0, 20)
    np.testing.assert_allclose(at(shown, t), at(waves, t - delay), atol=1e-11)


# deflection_gain: a gain error shows at every frequency alike, and on the deflection alone.


@pytest.mark.parametrize("error", [-0.3, 0.05])
def test_it_multiplies_the_deflection_alone(rig: Rig, numbers: dict[str, float], error: float) -> None:
    p = as_values(numbers | {"deflection_gain_error": error})
    accel, deflection = build_model(rig, ("deflection_gain",)).transfers(p, jnp.asarray([0.0, 0.5, 60.0]))
    np.testing.assert_allclose(deflection, 1.0 + error, rtol=1e-15)
    assert np.all(np.asarray(accel) == 1.0)
