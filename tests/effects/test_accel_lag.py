"""A first-order lag: its corner, and its delay far below it."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.effects.accel_lag import AccelLag

from .laws import typical

LAG = AccelLag()


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
