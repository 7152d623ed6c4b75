"""The noise of a sensor at rest."""

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.responses.outliers import estimate_standstill_noise
from savgs_ident.responses.summary import inspect

TIME = np.arange(4000) / 500.0
NOISE = 0.05 * np.random.default_rng(9).standard_normal(TIME.size)


def at_rest(values: NDArray[np.float64]) -> Campaign:
    """A campaign that is one standstill of one channel."""
    channel = RecordedChannel("sprung_accel", "m/s^2", TIME, values)
    return Campaign(
        "a.csv", (Recording("standstill", "standstill", None, {"sprung_accel": channel}),), (), ""
    )


def test_clean_noise_is_the_deviation_from_a_straight_line_bit_by_bit() -> None:
    values = NOISE + 0.3 + 0.01 * TIME
    trend = np.polynomial.Polynomial.fit(TIME, values, 1)
    noise, warnings = estimate_standstill_noise(at_rest(values))
    assert noise == {"sprung_accel": float(np.std(values - trend(TIME)))}
    assert warnings == ()
    assert estimate_standstill_noise(at_rest(np.full(TIME.size, 0.3)))[0] == {
        "sprung_accel": pytest.approx(0.0)
    }


def test_spikes_at_rest_are_no_noise() -> None:
    bad = NOISE.copy()
    bad[[500, 1500, 1501, 3000]] += np.array([2.5, -2.5, -2.0, 100.0])
    noise, (warning,) = estimate_standstill_noise(at_rest(bad))
    assert noise["sprung_accel"] == pytest.approx(float(np.std(NOISE)), rel=2e-3)
    assert float(np.std(bad)) > 10.0 * noise["sprung_accel"]
    assert (warning.code, warning.test, warning.channel) == ("outlying_samples", "standstill", "sprung_accel")
    assert "4 of 4000 samples" in warning.what
    assert warning.time == TIME[500]
    assert warning in inspect(at_rest(bad)).warnings


def test_a_quantised_sensor_at_rest_has_no_outliers() -> None:
    rounded = 0.1 * np.round(NOISE / 0.1)
    noise, warnings = estimate_standstill_noise(at_rest(rounded))
    assert warnings == ()
    assert noise["sprung_accel"] == pytest.approx(float(np.std(rounded)), rel=1e-3)
