"""Points and curves of a Bode figure against the response they come from."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from savgs_ident.fit.result import measured_points
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.report.bode import phase_deg
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.curves import model_curve

Response = Callable[[NDArray[np.float64], float], NDArray[np.complex128]]


def test_points_are_per_metre_of_the_measured_road(measured: HarmonicResponse) -> None:
    points = measured_points(measured, RIG_LAYOUT.responses, "road_height")
    road = measured.harmonics[:, 0, 1]
    assert_allclose(points.transfer[:, 0] * road, measured.harmonics[:, 1, 1])
    assert_allclose(points.peak_to_peak[:, 1], measured.peak_to_peak[:, 2])


def test_error_bars_agree_with_scatter(measured: HarmonicResponse) -> None:
    rng = np.random.default_rng(3)
    points = measured_points(measured, RIG_LAYOUT.responses, "road_height")
    factor = np.linalg.cholesky(measured.covariance[4, 1, 1])
    moved = factor @ rng.standard_normal((2, 20000))
    drawn = (measured.harmonics[4, 1, 1] + moved[0] + 1j * moved[1]) / measured.harmonics[4, 0, 1].real
    assert_allclose(points.magnitude_sd[4, 0], np.std(np.abs(drawn)), rtol=0.03)
    assert_allclose(points.phase_sd[4, 0], np.std(np.angle(drawn / points.transfer[4, 0])), rtol=0.03)


def test_a_channel_that_was_not_recorded_is_left_open(measured: HarmonicResponse) -> None:
    other = replace(measured, channels=("road_height", "sprung_accel", "something_else"))
    points = measured_points(other, RIG_LAYOUT.responses, "road_height")
    assert np.isnan(points.transfer[:, 1]).all()
    assert np.isfinite(points.transfer[:, 0]).all()


def test_frequencies_that_were_not_solved_are_left_open(mass_on_spring: Response) -> None:
    frequency = np.array([1.0, 2.0, 3.0])
    harmonics = mass_on_spring(frequency, 0.2)
    road = np.full(3, 0.01375 + 0.0j)
    curve = model_curve("model", frequency, harmonics, road, np.array([True, False, True]))
    assert np.isnan(curve.transfer[1]).all()
    assert np.isnan(curve.peak_to_peak[1]).all()
    assert_allclose(curve.transfer[[0, 2]], harmonics[[0, 2], :, 1] / 0.01375)


def test_phase_falls_through_a_resonance_without_jumps(mass_on_spring: Response) -> None:
    frequency = np.geomspace(0.2, 20.0, 80)
    phase = phase_deg(mass_on_spring(frequency, 0.05)[:, 0, 1])
    assert 170.0 < phase[0] < 181.0
    assert np.all(np.abs(np.diff(phase)) < 60.0)
    assert np.all(np.diff(phase[10:40]) < 0.0)


def test_phase_passes_over_gaps() -> None:
    phase = phase_deg(np.exp(1j * np.radians([170.0, np.nan, 190.0])))
    assert_allclose(phase, [170.0, np.nan, 190.0])
