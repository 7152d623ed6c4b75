"""Samples as a quadratic form over nodes: nothing is lost, and phases are those of the harmonics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.fit.collocation.transcription import Samples, interpolation, misfit_of, samples_of
from savgs_ident.recordings.recording import RecordedChannel, Recording


def _nodes(seed: int, count: int = 24) -> NDArray[np.float64]:
    """Uneven nodes of a period, the last of them where the next period begins."""
    gaps = np.random.default_rng(seed).uniform(0.3, 1.7, count)
    return 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()


@given(st.integers(0, 1000))
def test_a_cubic_is_interpolated_exactly(seed: int) -> None:
    """Away from where one period meets the next."""
    rng = np.random.default_rng(seed)
    nodes, coefficients = _nodes(seed), rng.standard_normal(4)
    phase = rng.uniform(nodes[2], nodes[-3], 50)
    found = interpolation(nodes, phase) @ np.polyval(coefficients, nodes)
    assert found == pytest.approx(np.polyval(coefficients, phase), rel=1e-10, abs=1e-10)


@given(st.integers(0, 1000))
def test_one_period_goes_over_into_the_next(seed: int) -> None:
    """Values at the ends are interpolated as those of a shifted period are in its middle."""
    rng = np.random.default_rng(seed)
    nodes, values = _nodes(seed), rng.standard_normal(24)
    phase = rng.uniform(0.0, 2.0 * np.pi, 50)
    shift = 12
    moved = np.mod(nodes - nodes[shift], 2.0 * np.pi)
    order = np.argsort(moved)
    there = np.mod(phase - nodes[shift], 2.0 * np.pi)
    expected = interpolation(moved[order], there) @ values[order]
    assert interpolation(nodes, phase) @ values == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_node_gives_its_own_value() -> None:
    nodes = _nodes(3)
    assert interpolation(nodes, nodes).toarray() == pytest.approx(np.eye(24), abs=1e-12)


@given(st.integers(0, 1000))
def test_the_quadratic_form_is_the_sum_of_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes, phase = _nodes(seed), rng.uniform(0.0, 2.0 * np.pi, 400)
    samples = Samples(phase, rng.standard_normal(400), 0.3)
    misfit = misfit_of(samples, nodes)
    m, zero = rng.standard_normal(24), float(rng.standard_normal())
    v = np.append(m, zero)
    found = 0.5 * v @ (misfit.curvature @ v) - misfit.slope @ v + misfit.rest
    left = samples.values - interpolation(nodes, phase) @ m - zero
    assert found == pytest.approx(0.5 * np.sum(left**2) / 0.3**2, rel=1e-11)
    assert misfit.samples == 400


def test_phases_count_from_the_top_of_the_road_on_each_clock() -> None:
    """The road is not sampled when the accelerometer is, and starts anywhere in its cycle."""
    frequency, start, lag = 1.7, 0.9, 0.4
    omega = 2.0 * np.pi * frequency
    slow, fast = np.arange(400) / 50.0, 0.0031 + np.arange(1700) / 200.0
    road = 0.01 * np.cos(omega * slow + start) + 1e-4 * np.cos(2.0 * omega * slow)
    accel = 3.0 * np.cos(omega * fast + start - lag)
    accel[7] = np.nan
    recording = Recording(
        "dwell",
        "dwell",
        frequency,
        {
            "road_height": RecordedChannel("road_height", "m", slow, road),
            "sprung_accel": RecordedChannel("sprung_accel", "m/s^2", fast, accel),
        },
    )
    found = samples_of(recording, "road_height", frequency, {"sprung_accel": 0.05})
    assert set(found) == {"sprung_accel"}
    samples = found["sprung_accel"]
    assert samples.values.size == 1699
    assert samples.values == pytest.approx(3.0 * np.cos(samples.phase - lag), abs=1e-6)
