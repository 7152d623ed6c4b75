"""A simulated sweep as files and tables, from a series whose peak is known."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from savgs_ident.core.files import to_json, write_table
from savgs_ident.core.status import Status
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.report.model import sweep_columns, sweep_figure, sweep_record
from savgs_ident.report.theme import write_figure
from savgs_ident.simulate.public import DURATION_S, HIGHEST_HZ, SimulatedSweep, simulate_sweep


@pytest.fixture
def sweep(rig: Rig) -> SimulatedSweep:
    """A chirp with a bump at 40 s, where the cam turns at 2 Hz."""
    time = np.linspace(0.0, DURATION_S, 6001)
    wave = np.sin(np.pi * HIGHEST_HZ / DURATION_S * time**2)
    accel = 5.0 * np.exp(-(((time - 40.0) / 5.0) ** 2)) * np.abs(wave)
    return SimulatedSweep(
        RigModel(rig), time, 0.01375 * wave, np.stack([accel, -1e-3 * accel]), Status.CONVERGED
    )


def test_the_peak_is_found_at_the_frequency_of_the_cam(sweep: SimulatedSweep) -> None:
    channels = json.loads(to_json(sweep_record(sweep)))["channels"]
    assert channels["sprung_accel"]["largest"] == pytest.approx(5.0, rel=0.02)
    assert channels["sprung_accel"]["peak_frequency_hz"] == pytest.approx(2.0, abs=0.02)
    assert channels["susp_deflection"]["smallest"] == pytest.approx(-5e-3, rel=0.02)
    assert channels["susp_deflection"]["peak_frequency_hz"] == channels["sprung_accel"]["peak_frequency_hz"]


def test_the_series_is_read_back_as_a_recording(sweep: SimulatedSweep, tmp_path: Path) -> None:
    write_table(tmp_path / "sweep.csv", sweep_columns(sweep))
    (recording,) = load_campaign(tmp_path / "sweep.csv").recordings
    assert_allclose(recording.channels["sprung_accel"].values, sweep.readings[0], atol=1e-8)
    assert_allclose(recording.channels["road_height"].values, sweep.driven, atol=1e-10)


def test_a_motion_that_was_lost_claims_no_peak(sweep: SimulatedSweep) -> None:
    lost = SimulatedSweep(sweep.model, sweep.time, sweep.driven, sweep.readings, Status.NOT_FINITE)
    record = json.loads(to_json(sweep_record(lost)))
    assert record["status"] == "not_finite"
    assert record["channels"]["sprung_accel"]["peak_frequency_hz"] is None


def test_the_picture_has_units(sweep: SimulatedSweep, tmp_path: Path) -> None:
    figure = sweep_figure(sweep)
    assert ["[m/s²]" in figure.axes[0].get_ylabel(), "[mm]" in figure.axes[1].get_ylabel()] == [True, True]
    assert figure.axes[1].get_xlabel() == "time [s]"
    write_figure(tmp_path, "simulate", figure)


@pytest.mark.slow
def test_the_frictionless_rig_peaks_soon_after_its_resonance(rig: Rig) -> None:
    record = json.loads(to_json(sweep_record(simulate_sweep(RigModel(rig)))))
    assert record["status"] == "converged"
    assert 1.9 < record["channels"]["sprung_accel"]["peak_frequency_hz"] < 2.3
