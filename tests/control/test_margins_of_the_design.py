"""The margins of the shipped design: just short of each the loop is stable, just beyond it is not."""

import control
import numpy as np
import pytest

from savgs_ident.control.design import Design
from savgs_ident.control.digital import RATE, sampled_plant
from savgs_ident.control.margins import loop_of, margins_of


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
    return loop_of(control.ss(a, b, c, 0.0, 1.0 / RATE), design.digital.space)


def test_the_gain_margin_is_where_the_loop_turns_unstable(design: Design) -> None:
    for loop, margins in (
        (loop_of(design.plant, design.controller), design.margins),
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
    loop = loop_of(design.plant, design.controller)
    for share, stable in ((0.99, True), (1.01, False)):
        delay = control.ss(control.tf(*control.pade(share * design.margins.delay, 8)))
        assert _stable(loop * delay) == stable


def test_the_phase_margin_and_the_peak_are_those_of_a_brute_sweep(design: Design) -> None:
    loop = loop_of(design.plant, design.controller)
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
        return abs(margins_of(sampled_plant(design.plant, rate), space).phase_deg - design.margins.phase_deg)

    assert sampled(4000.0) < 0.5 * sampled(1000.0) < 0.25 * sampled(250.0)
