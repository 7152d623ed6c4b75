"""A sweep through a linear system whose response is known."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.signal

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.sweeps import estimate_sweep_response

RATE = 0.05
NATURAL, DAMPING = 2 * np.pi * 2.1, 0.25
FILTER = ([2 * DAMPING * NATURAL, NATURAL**2], [1.0, 2 * DAMPING * NATURAL, NATURAL**2])


@cache
def clean(duration: float) -> tuple[Any, Any, Any]:
    """Time [s], road [m] and filtered road [m] without noise."""
    time = np.arange(int(500 * duration)) / 500.0
    road = 0.01375 * np.sin(np.pi * RATE * time**2)
    _, filtered, _ = scipy.signal.lsim(FILTER, road, time)
    return time, road, np.asarray(filtered)


def sweep(seed: int, noise: float, duration: float = 60.0) -> Recording:
    """0 to 3 Hz in 60 s at 500 Hz; the channel is the filtered road, simulated on a fine grid."""
    rng = np.random.default_rng(seed)
    time, road, filtered = clean(duration)
    measured = filtered + noise * rng.standard_normal(time.size)
    road = road + 1e-5 * rng.standard_normal(time.size)
    half = time[::2] + 3e-4
    channels = {
        "road_height": RecordedChannel("road_height", "m", time, road),
        "susp_deflection": RecordedChannel("susp_deflection", "m", time, measured),
        "link_angle": RecordedChannel("link_angle", "rad", half, 2.0 * np.interp(half, time, road)),
    }
    return Recording("sweep", "sweep", None, channels)


def expected(frequency: Any, window: Any) -> Any:
    """Steady response; what the sweep adds, -(i/2) (dw/dt) H''(w) + H''(w) (dw/dt)^2 T^2 / 24."""
    speed = 2 * np.pi * frequency

    def steady(w: Any) -> Any:
        return np.polyval(FILTER[0], 1j * w) / np.polyval(FILTER[1], 1j * w)

    step = 1e-3
    bend = (steady(speed + step) - 2 * steady(speed) + steady(speed - step)) / step**2
    rate = 2 * np.pi * RATE
    return steady(speed), (-0.5j * rate + (rate * window) ** 2 / 24.0) * bend


def test_frequency_and_rate_follow_the_road() -> None:
    response = estimate_sweep_response(sweep(1, 1e-4), "road_height")
    pull = (response.frequency - RATE * response.time) / response.frequency_sd
    assert np.abs(pull).max() < 5.0
    assert response.sweep_rate == pytest.approx(RATE, rel=0.01)
    assert response.input_amplitude == pytest.approx(0.01375, rel=1e-3)


@pytest.mark.slow
def test_response_is_the_linear_one_with_its_known_bias() -> None:
    """Averaged over draws: right to 0.3 per cent once the two terms that the docstring states are added."""
    runs = [estimate_sweep_response(sweep(seed, 1e-4), "road_height") for seed in range(6)]
    frequency = runs[0].frequency
    steady, bias = expected(frequency, runs[0].window_s)
    c = runs[0].channel("susp_deflection")
    mean = np.mean([run.response[:, c] for run in runs], axis=0)
    settled = frequency > 0.9
    error = np.abs(mean - steady - bias)[settled]
    noise = runs[0].response_sd[settled, c] * np.sqrt(2.0 / len(runs))
    assert np.all(error < 4.0 * noise + 3e-3 * np.abs(steady[settled]))
    assert np.max(np.abs(bias)[settled]) > np.max(error)


@pytest.mark.slow
def test_deviation_is_the_scatter_of_repeated_sweeps() -> None:
    runs = [estimate_sweep_response(sweep(seed, 3e-4), "road_height") for seed in range(12)]
    c = runs[0].channel("susp_deflection")
    every = np.stack([run.response[:, c] for run in runs])
    scatter = np.sqrt(0.5 * (np.var(every.real, axis=0, ddof=1) + np.var(every.imag, axis=0, ddof=1)))
    stated = np.sqrt(np.mean([run.response_sd[:, c] ** 2 for run in runs], axis=0))
    ratio = float(np.mean(scatter**2) / np.mean(stated**2))
    assert ratio == pytest.approx(1.0, abs=0.2)


def test_a_channel_on_another_clock_needs_no_resampling() -> None:
    response = estimate_sweep_response(sweep(3, 1e-4), "road_height")
    c = response.channel("link_angle")
    assert np.abs(response.response[:, c] - 2.0).max() < 0.01


def test_a_sweep_without_road_or_too_short_is_refused() -> None:
    whole = sweep(4, 1e-4, duration=12.0)
    with pytest.raises(InputError, match=r"cycles, 5 are needed.*Remedy"):
        estimate_sweep_response(whole, "road_height")
    blind = Recording("sweep", "sweep", None, {"susp_deflection": whole.channels["susp_deflection"]})
    with pytest.raises(InputError, match=r"no motion of road_height.*Remedy"):
        estimate_sweep_response(blind, "road_height", source="run.csv")
