"""The recordings of the rig: noise as their README states it, and the same response from every file."""

from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.sweeps import estimate_sweep_response

from ..in_one_test import over


@pytest.fixture(scope="module")
def from_csv(shared_rig: Path) -> HarmonicResponse:
    return estimate_response(load_campaign(shared_rig / "nominal" / "campaign.csv.gz"))


@pytest.fixture(scope="module")
def from_ros2(shared_rig: Path) -> HarmonicResponse:
    return estimate_response(load_campaign(shared_rig / "nominal" / "campaign_ros2.mcap"))


def test_all_dwells_with_their_frequencies(from_csv: HarmonicResponse) -> None:
    asked = [float(test.removeprefix("dwell_").removesuffix("Hz")) for test in from_csv.tests]
    assert len(asked) == 28
    pull = (from_csv.frequency - asked) / from_csv.frequency_sd
    assert np.abs(pull).max() < 5.0
    assert np.all(from_csv.periods >= 8)


@pytest.mark.parametrize(
    ("channel", "sample", "percent"), [("sprung_accel", 0.05, 0.14), ("susp_deflection", 1e-4, 0.04)]
)
def test_noise_is_that_of_the_sensors(
    from_csv: HarmonicResponse, channel: str, sample: float, percent: float
) -> None:
    c = from_csv.channel(channel)
    assert float(np.median(from_csv.noise_sd[:, c])) == pytest.approx(sample, rel=0.03)
    spread = np.trace(from_csv.covariance[:, c, 1], axis1=-2, axis2=-1)
    relative = 100 * np.sqrt(spread) / np.abs(from_csv.harmonics[:, c, 1])
    assert 0.4 * percent < float(np.sqrt(np.mean(relative**2))) < 2.0 * percent


@pytest.mark.slow
@over(
    "channel",
    ["road_height", "sprung_accel", "susp_deflection", "link_angle", "link_velocity", "motor_current"],
)
def test_other_clocks_rates_and_noise_give_the_same_response(
    from_csv: HarmonicResponse, from_ros2: HarmonicResponse, channel: str
) -> None:
    """Squared pulls average to one per degree of freedom; folding is allowed for, not exactly known."""
    i, j = from_csv.channel(channel), from_ros2.channel(channel)
    valid = from_csv.valid[:, i] & from_ros2.valid[:, j]
    valid[:, 0] = False
    if channel == "road_height":
        valid[:, 1] = False
    error = (from_csv.harmonics[:, i] - from_ros2.harmonics[:, j])[valid]
    pulls = np.stack([error.real, error.imag], axis=-1)
    covariance = (from_csv.covariance[:, i] + from_ros2.covariance[:, j])[valid]
    distance = np.einsum("ki,ki->k", pulls, np.linalg.solve(covariance, pulls[..., None])[..., 0])
    degrees = 2 * distance.size
    high = scipy.stats.chi2.isf(1e-4, degrees) / degrees
    assert 0.6 < float(distance.sum()) / degrees < max(high, 1.25)


def test_sweep_is_near_the_dwells(shared_rig: Path, from_csv: HarmonicResponse) -> None:
    """A sweep of 0.05 Hz/s through a rig with friction stays within 3 % of the dwells from 1 to 2.9 Hz."""
    campaign = load_campaign(shared_rig / "nominal" / "campaign.csv.gz")
    (recording,) = campaign.of_kind("sweep")
    swept = estimate_sweep_response(recording, "road_height")
    inside = (from_csv.frequency > 1.0) & (from_csv.frequency < 2.9)
    for channel in ("sprung_accel", "susp_deflection"):
        road = from_csv.harmonics[:, from_csv.channel("road_height"), 1]
        steady = (from_csv.harmonics[:, from_csv.channel(channel), 1] / road)[inside]
        moving = np.abs(swept.response[:, swept.channel(channel)])
        near = np.interp(from_csv.frequency[inside], swept.frequency, moving)
        assert np.abs(near / np.abs(steady) - 1.0).max() < 0.03
