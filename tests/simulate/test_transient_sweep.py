"""A minute of sweep: against the recorded one, and against the dwells that it passes."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.plants.profiles import tabulated
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.inputs import (
    ImposedLink,
    RigSource,
    RoadMotion,
    cam_excitation,
    held_link,
    sweep_road,
)
from savgs_ident.plants.quarter_car.kinematics import Values
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import Campaign
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.transient import simulate_transient

pytestmark = pytest.mark.slow
CHANNELS = ("sprung_accel", "susp_deflection")


@pytest.fixture(scope="module")
def simtr(rig: Rig) -> QuarterCar:
    return build_model(rig, MODELS["simtr"])


@pytest.fixture(scope="module")
def truth(rig: Rig) -> Values:
    """The numbers that are true of the nominal recordings."""
    p = model_parameters(rig, MODELS["simtr"]).as_dict()
    true = p | {"c_sd": 0.93 * p["c_sd"], "k_sd": 0.985 * p["k_sd"], "k_t": 0.96 * p["k_t"]}
    return {name: jnp.asarray(value) for name, value in true.items()}


@pytest.fixture(scope="module")
def campaign(shared_rig: Path) -> Campaign:
    return load_campaign(shared_rig / "nominal" / "campaign.csv.gz")


def test_the_recorded_sweep_is_met_within_its_noise(
    simtr: QuarterCar, truth: Values, campaign: Campaign
) -> None:
    (sweep,), (still,) = campaign.of_kind("sweep"), campaign.of_kind("standstill")
    times = sweep.channels["sprung_accel"].time
    road, link = (
        tabulated(sweep.channels[name].time, sweep.channels[name].values)
        for name in ("road_height", "link_angle")
    )
    source = RigSource(RoadMotion(road), ImposedLink(link))
    solution = simulate_transient(simtr, truth, source, times, tolerance=1e-6)
    assert solution.status().ok
    for name, allowed in zip(CHANNELS, (0.005, 0.002), strict=True):
        measured = sweep.channels[name].values
        error = np.std(np.asarray(getattr(solution.readings, name)) - measured)
        noise = np.std(still.channels[name].values)
        # What is left above the sensor's own noise, as a share of the signal.
        left = np.sqrt(max(error**2 - noise**2, 0.0)) / np.std(measured)
        print(f"{name}: error {error / np.std(measured):.5f}, beyond noise {left:.5f} of the signal")
        assert left < allowed, name


def test_a_slow_sweep_passes_through_the_dwells(simtr: QuarterCar, truth: Values) -> None:
    """Near 2 Hz the sweep's own fundamental is within a few per cent that of the dwell."""
    road, times = sweep_road(0.0275, 0.0, 3.0, 60.0), np.linspace(0.0, 60.0, 30_001)
    solution = simulate_transient(
        simtr, truth, RigSource(road, held_link(np.pi / 2.0)), times, tolerance=1e-6
    )
    assert solution.status().ok
    near = np.abs(times - 40.0) < 1.0
    phase = 2.0 * np.pi * 0.025 * times[near] ** 2
    window = np.hanning(phase.size)
    dwell = simulate_periodic(simtr, truth, cam_excitation([2.0], 0.0275, np.pi / 2.0))
    expected = np.abs(np.asarray(harmonics(simtr, truth, dwell, 1)))[0, :, 1]
    for name, amplitude in zip(CHANNELS, expected, strict=True):
        signal = np.asarray(getattr(solution.readings, name))[near]
        kernel = window * np.exp(-1j * phase)
        found = 2.0 * abs(np.sum(kernel * (signal - signal.mean())) / window.sum())
        assert found == pytest.approx(amplitude, rel=0.05), name
