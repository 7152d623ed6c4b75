"""Margins of loops: known ones, those of the design, and over a set of rigs."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.control.design import Design
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS, design_loop
from savgs_ident.control.linear_equivalent import TwoMasses, quarter_car_space
from savgs_ident.control.synthesis import (
    RATE,
    Margins,
    Synthesis,
    assess_robustness,
    compute_margins,
    open_loop,
    sampled_plant,
    sensitivity,
)

S = control.tf("s")


def _of(loop: control.TransferFunction) -> Margins:
    """Of a loop L under negative feedback: the controller turns the sign."""
    plant = control.ss(loop)
    return compute_margins(plant, control.ss([], [], [], [[-1.0]], plant.dt))


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


@pytest.mark.slow
@given(k=st.floats(6.1, 50.0))
def test_beyond_its_gain_margin_the_loop_is_unstable(k: float) -> None:
    found = _of(k / (S * (S + 1) * (S + 2)))
    assert not found.stable
    assert found.gain_down == pytest.approx(6.0 / k, rel=1e-6)


@pytest.mark.slow
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


@given(k=st.floats(0.05, 0.95))
def test_a_loop_that_turns_its_sign_at_standstill_ends_there(k: float) -> None:
    """L = -k/(s+1): the closed pole k - 1 reaches zero at k = 1, at zero frequency."""
    found = _of(-k / (S + 1))
    assert found.stable
    assert found.gain_up == pytest.approx(1.0 / k, rel=1e-9)
    assert found.sensitivity == pytest.approx(1.0 / (1.0 - k), rel=1e-9)


@given(k=st.floats(1.1, 20.0))
def test_an_unstable_plant_needs_its_gain(k: float) -> None:
    found = _of(k / (S - 1))
    w = np.sqrt(k**2 - 1.0)
    assert found.stable
    assert found.gain_down == pytest.approx(1.0 / k, rel=1e-9)
    assert found.gain_up == np.inf
    assert found.phase_deg == pytest.approx(np.degrees(np.arctan(w)), abs=1e-5)
    assert not _of(k / (S - 1) / k * 0.9).stable


@pytest.mark.slow
@given(k=st.floats(0.1, 1.4))
def test_a_sampled_loop_ends_at_half_its_rate(k: float) -> None:
    """L = k/(z - 0.5): the closed pole 0.5 - k leaves the circle at -1."""
    z = control.tf([1.0, 0.0], [1.0], 1e-3)
    found = _of(k / (z - 0.5))
    assert found.stable
    assert found.gain_up == pytest.approx(1.5 / k, rel=1e-9)
    assert found.sensitivity == pytest.approx(1.0 / (1.0 - k / 1.5), rel=1e-6)
    assert not _of((k + 1.5) / (z - 0.5)).stable


@pytest.mark.slow
@given(k=st.floats(0.05, 0.25), lag=st.floats(0.01, 10.0), resonance=st.floats(0.3, 0.9))
def test_the_peak_of_the_sensitivity_is_the_largest_of_a_brute_sweep(
    k: float, lag: float, resonance: float
) -> None:
    # Lag and resonance bend it towards -1; so little gain leaves it a distance of more than a half.
    loop = k / (S * (lag * S + 1) * (S * S + 2 * resonance * S + 1))
    plant, sign = control.ss(loop), control.ss([], [], [], [[-1.0]])
    swept = np.abs(sensitivity(open_loop(plant, sign), np.geomspace(1e-3, 1e3, 20_001)))
    assert compute_margins(plant, sign).sensitivity == pytest.approx(swept.max(), rel=1e-4)


@given(k=st.floats(0.1, 5.9))
def test_the_sign_of_the_loop_is_that_of_the_return_difference(k: float) -> None:
    plant, law = control.ss(k / (S + 1)), control.ss(-2.0 / (S + 3))
    closed = 1.0 / sensitivity(open_loop(plant, law), np.array([0.7]))
    s = 2j * np.pi * 0.7
    assert closed[0] == pytest.approx(1.0 + 2.0 * k / ((s + 1.0) * (s + 3.0)))


def _stable(loop: control.StateSpace) -> bool:
    """Whether L with negative feedback is stable, by the closed loop's matrix."""
    closed = loop.A - loop.B @ loop.C / (1.0 + loop.D[0, 0])
    poles = np.linalg.eigvals(closed)
    return bool(np.all(np.abs(poles) < 1.0 if loop.isdtime(strict=True) else poles.real < 0.0))


def _sampled_loop(design: Design) -> control.StateSpace:
    """By hand: the plant's exact step response to a held command, which arrives a sample after the readings."""
    held = control.sample_system(design.plant, 1.0 / RATE, method="zoh")
    a = np.block([[held.A, held.B], [np.zeros((1, held.nstates + 1))]])
    b, c = np.eye(held.nstates + 1)[:, -1:], np.hstack([held.C, held.D])
    return open_loop(control.ss(a, b, c, 0.0, 1.0 / RATE), design.digital.space)


def test_the_gain_margin_is_where_the_loop_turns_unstable(design: Design) -> None:
    for loop, margins in (
        (open_loop(design.plant, design.controller), design.margins),
        (_sampled_loop(design), design.digital_margins),
    ):
        assert margins.stable
        assert _stable(loop * (0.999 * margins.gain_up))
        assert not _stable(loop * (1.001 * margins.gain_up))
        assert margins.gain_down == 0.0
        assert all(_stable(loop * factor) for factor in np.geomspace(1e-3, 0.999 * margins.gain_up, 40))


def test_the_delay_margin_is_where_the_sampled_loop_turns_unstable(design: Design) -> None:
    """Whole samples of delay between the command and the drive."""
    most = design.digital_margins.delay * RATE
    loop, late = _sampled_loop(design), int(np.floor(most))
    assert late > 10
    for samples, stable in ((late, True), (late + 1, False)):
        shift = np.eye(samples, k=-1)
        delay = control.ss(shift, np.eye(samples)[:, :1], np.eye(samples)[-1:], 0.0, 1.0 / RATE)
        assert _stable(loop * delay) == stable


def test_the_delay_margin_is_where_the_continuous_loop_turns_unstable(design: Design) -> None:
    loop = open_loop(design.plant, design.controller)
    for share, stable in ((0.99, True), (1.01, False)):
        delay = control.ss(control.tf(*control.pade(share * design.margins.delay, 8)))
        assert _stable(loop * delay) == stable


def test_the_phase_margin_and_the_peak_are_those_of_a_brute_sweep(design: Design) -> None:
    loop = open_loop(design.plant, design.controller)
    response = np.ravel(loop(2j * np.pi * np.geomspace(1e-3, 1e3, 60_001)))
    crossed = np.flatnonzero(np.diff(np.sign(np.abs(response) - 1.0)))
    assert crossed.size > 0
    phase = np.min(np.abs(np.degrees(np.angle(-response[crossed]))))
    assert design.margins.phase_deg == pytest.approx(phase, abs=0.05)
    assert design.margins.sensitivity == pytest.approx(np.max(1.0 / np.abs(1.0 + response)), rel=1e-4)


def test_sampling_costs_one_and_a_half_samples_of_the_delay_margin(design: Design) -> None:
    """The computer needs one, and what it holds is on average half a sample old; the rest hardly changes."""
    lost = design.margins.delay - design.digital_margins.delay
    assert lost == pytest.approx(1.5 / RATE, rel=0.05)
    assert design.digital_margins.gain_up == pytest.approx(design.margins.gain_up, rel=0.1)
    assert design.digital_margins.phase_deg == pytest.approx(design.margins.phase_deg, abs=4.0)
    assert design.digital_margins.sensitivity == pytest.approx(design.margins.sensitivity, rel=0.1)


def test_the_margins_of_a_faster_computer_are_nearer_to_the_continuous_ones(design: Design) -> None:
    def sampled(rate: float) -> float:
        space = control.sample_system(design.controller, 1.0 / rate, method="bilinear")
        return abs(
            compute_margins(sampled_plant(design.plant, rate), space).phase_deg - design.margins.phase_deg
        )

    assert sampled(4000.0) < 0.5 * sampled(1000.0) < 0.25 * sampled(250.0)


def test_the_nominal_rig_does_what_the_design_promised(
    synthesis: Synthesis, masses: TwoMasses, bandwidth: float
) -> None:
    found = assess_robustness(synthesis.controller, [masses], bandwidth, DEFAULT_WEIGHTS)
    assert found.stable
    assert found.peaks[0] == pytest.approx(synthesis.peak, rel=1e-6)
    assert found.margins[0] == compute_margins(
        design_loop(quarter_car_space(masses), bandwidth), synthesis.controller
    )


def test_a_rig_that_it_does_not_hold_is_the_worst(
    synthesis: Synthesis, masses: TwoMasses, bandwidth: float
) -> None:
    """An eighth of the chassis: the same strut accelerates it eight times as much, beyond the gain margin."""
    light = masses._replace(mass=masses.mass / 8.0)
    found = assess_robustness(synthesis.controller, [masses, light, masses], bandwidth, DEFAULT_WEIGHTS)
    assert not found.stable
    assert [each.stable for each in found.margins] == [True, False, True]
    assert found.peaks[1] == float("inf")
    assert found.worst == 1
    loop = design_loop(quarter_car_space(light), bandwidth)
    closed = control.feedback(loop, synthesis.controller, sign=1)
    assert max(closed.poles().real) > 0.0


def test_the_rigs_are_in_their_order(synthesis: Synthesis, masses: TwoMasses, bandwidth: float) -> None:
    rigs = [masses._replace(k_eq=share * masses.k_eq) for share in (0.95, 1.0, 1.05)]
    together = assess_robustness(synthesis.controller, rigs, bandwidth, DEFAULT_WEIGHTS)
    single = [
        assess_robustness(synthesis.controller, [rig], bandwidth, DEFAULT_WEIGHTS).peaks[0] for rig in rigs
    ]
    assert together.peaks == pytest.approx(single)
    assert together.worst == single.index(max(single))
