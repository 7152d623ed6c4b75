"""Margins of loops for which they can be written down."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from savgs_ident.control.margins import Margins, loop_of, margins_of, sensitivity_of

S = control.tf("s")


def _of(loop: control.TransferFunction) -> Margins:
    """Of a loop L under negative feedback: the controller turns the sign."""
    plant = control.ss(loop)
    return margins_of(plant, control.ss([], [], [], [[-1.0]], plant.dt))


@settings(max_examples=10)
@given(k=st.floats(0.1, 5.9))
def test_three_lags_have_the_gain_and_the_phase_of_the_book(k: float) -> None:
    """L = k/(s (s+1) (s+2)): real at w = sqrt(2), where it is -k/6."""
    found = _of(k / (S * (S + 1) * (S + 2)))
    # |L| = 1: x (x + 1) (x + 4) = k^2 with x = w^2.
    (square,) = (root.real for root in np.roots([1.0, 5.0, 4.0, -(k**2)]) if root.real > 0.0)
    w = np.sqrt(square)
    phase = np.pi / 2.0 - np.arctan(w) - np.arctan(w / 2.0)
    assert found.stable
    assert found.gain_up == pytest.approx(6.0 / k, rel=1e-6)
    assert found.gain_down == 0.0
    assert found.phase_deg == pytest.approx(np.degrees(phase), abs=1e-5)
    assert found.delay == pytest.approx(phase / w, rel=1e-6)


@settings(max_examples=10)
@given(k=st.floats(6.1, 50.0))
def test_beyond_its_gain_margin_the_loop_is_unstable(k: float) -> None:
    found = _of(k / (S * (S + 1) * (S + 2)))
    assert not found.stable
    assert found.gain_down == pytest.approx(6.0 / k, rel=1e-6)


@settings(max_examples=10)
@given(k=st.floats(1.1, 1e3))
def test_one_lag_stands_any_gain_and_loses_only_its_phase(k: float) -> None:
    found = _of(k / (S + 1))
    w = np.sqrt(k**2 - 1.0)
    assert found.stable
    assert (found.gain_up, found.gain_down) == (np.inf, 0.0)
    assert found.phase_deg == pytest.approx(180.0 - np.degrees(np.arctan(w)), abs=1e-5)
    assert found.delay == pytest.approx((np.pi - np.arctan(w)) / w, rel=1e-6)
    # It never comes nearer to -1 than at infinite frequency.
    assert found.sensitivity == pytest.approx(1.0, rel=1e-12)


@settings(max_examples=10)
@given(k=st.floats(0.05, 0.95))
def test_a_loop_that_turns_its_sign_at_standstill_ends_there(k: float) -> None:
    """L = -k/(s+1): the closed pole k - 1 reaches zero at k = 1, at zero frequency."""
    found = _of(-k / (S + 1))
    assert found.stable
    assert found.gain_up == pytest.approx(1.0 / k, rel=1e-9)
    assert found.sensitivity == pytest.approx(1.0 / (1.0 - k), rel=1e-9)


@settings(max_examples=10)
@given(k=st.floats(1.1, 20.0))
def test_an_unstable_plant_needs_its_gain(k: float) -> None:
    found = _of(k / (S - 1))
    w = np.sqrt(k**2 - 1.0)
    assert found.stable
    assert found.gain_down == pytest.approx(1.0 / k, rel=1e-9)
    assert found.gain_up == np.inf
    assert found.phase_deg == pytest.approx(np.degrees(np.arctan(w)), abs=1e-5)
    assert not _of(k / (S - 1) / k * 0.9).stable


@settings(max_examples=10)
@given(k=st.floats(0.1, 1.4))
def test_a_sampled_loop_ends_at_half_its_rate(k: float) -> None:
    """L = k/(z - 0.5): the closed pole 0.5 - k leaves the circle at -1."""
    z = control.tf([1.0, 0.0], [1.0], 1e-3)
    found = _of(k / (z - 0.5))
    assert found.stable
    assert found.gain_up == pytest.approx(1.5 / k, rel=1e-9)
    assert found.sensitivity == pytest.approx(1.0 / (1.0 - k / 1.5), rel=1e-6)
    assert not _of((k + 1.5) / (z - 0.5)).stable


@settings(max_examples=10)
@given(k=st.floats(0.05, 0.25), lag=st.floats(0.01, 10.0), resonance=st.floats(0.3, 0.9))
def test_the_peak_of_the_sensitivity_is_the_largest_of_a_brute_sweep(
    k: float, lag: float, resonance: float
) -> None:
    # Lag and resonance bend it towards -1; so little gain leaves it a distance of more than a half.
    loop = k / (S * (lag * S + 1) * (S * S + 2 * resonance * S + 1))
    plant, sign = control.ss(loop), control.ss([], [], [], [[-1.0]])
    swept = np.abs(sensitivity_of(loop_of(plant, sign), np.geomspace(1e-3, 1e3, 20_001)))
    assert margins_of(plant, sign).sensitivity == pytest.approx(swept.max(), rel=1e-4)


@settings(max_examples=10)
@given(k=st.floats(0.1, 5.9))
def test_the_sign_of_the_loop_is_that_of_the_return_difference(k: float) -> None:
    plant, law = control.ss(k / (S + 1)), control.ss(-2.0 / (S + 3))
    closed = 1.0 / sensitivity_of(loop_of(plant, law), np.array([0.7]))
    s = 2j * np.pi * 0.7
    assert closed[0] == pytest.approx(1.0 + 2.0 * k / ((s + 1.0) * (s + 3.0)))
