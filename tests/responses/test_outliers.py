"""Spikes and dropouts of a dwell: left out, said, and nothing else touched."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import savgs_ident.responses.dwells as dwells
import savgs_ident.responses.outliers as outliers
from savgs_ident.plants.quarter_car.model import load_model
from savgs_ident.plants.quarter_car.rig import default_campaign_path
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.responses.dwell_fit import fit_dwell
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.outliers import RobustDwell, WaveformSamples, check_outliers
from savgs_ident.responses.summary import inspect
from savgs_ident.simulate.compared_tests import campaign_of, measured_response

from .corruption import drop, spike

NAMES = ("road_height", "sprung_accel", "susp_deflection")
WARNED = {"outlying_samples", "unreliable_sensor"}


def corrupted(campaign: Campaign, names: tuple[str, ...], change: Any) -> Campaign:
    """The campaign with ``change`` applied to the values of some channels of its dwells."""

    def apply(recording: Recording) -> Recording:
        if recording.kind != "dwell":
            return recording
        changed = {
            name: replace(channel, values=change(channel.values))
            for name, channel in recording.channels.items()
            if name in names
        }
        return replace(recording, channels={**recording.channels, **changed})

    return replace(campaign, recordings=tuple(apply(recording) for recording in campaign.recordings))


def plain_response(campaign: Campaign) -> HarmonicResponse:
    """The response with no sample left out."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            dwells,
            "fit_robust_dwell",
            lambda groups, *rest: RobustDwell(fit_dwell(groups, *rest), groups, {}),
        )
        return estimate_response(campaign)


def error_in_sd(response: HarmonicResponse, clean: HarmonicResponse, name: str) -> NDArray[np.float64]:
    """Distance of the valid harmonics of a channel from those of ``clean`` [standard deviations of the latter]."""
    c = clean.channel(name)
    sd = np.sqrt(np.trace(clean.covariance[:, c], axis1=-2, axis2=-1))
    valid = response.valid[:, c] & clean.valid[:, c]
    assert np.array_equal(response.valid, clean.valid)
    distance: NDArray[np.float64] = (
        np.abs(response.harmonics[:, c] - clean.harmonics[:, c])[valid] / sd[valid]
    )
    return distance


@pytest.fixture(scope="module")
def shipped() -> Campaign:
    """Some dwells of the shipped campaign, and what else it holds."""
    campaign = load_campaign(default_campaign_path())
    kept = {recording.name for recording in campaign.of_kind("dwell")[::5]}
    return replace(
        campaign,
        recordings=tuple(each for each in campaign.recordings if each.kind != "dwell" or each.name in kept),
    )


@pytest.fixture(scope="module")
def clean(shipped: Campaign) -> HarmonicResponse:
    """What is estimated from it."""
    return estimate_response(shipped)


@pytest.mark.slow
def test_a_clean_campaign_keeps_its_numbers_bit_by_bit() -> None:
    campaign = load_campaign(default_campaign_path())
    robust, plain = estimate_response(campaign), plain_response(campaign)
    for name, value in vars(plain).items():
        other = getattr(robust, name)
        same = value.tobytes() == other.tobytes() if isinstance(value, np.ndarray) else value == other
        assert same, name
    assert not WARNED & {warning.code for warning in robust.warnings}


def test_no_sample_of_noise_free_friction_is_an_outlier(synthetic: Any) -> None:
    rng = np.random.default_rng(8)
    signals = {
        "road_height": synthetic.road(0.0),
        "sprung_accel": synthetic.Signal(synthetic.stepped(2.0, 2000), 250.0, synthetic.white(0.0)),
    }
    for frequency in (0.5, 1.7, 6.3):
        campaign = synthetic.campaign(synthetic.dwell(rng, signals, frequency, 12.0 / frequency))
        assert not WARNED & {warning.code for warning in estimate_response(campaign).warnings}


def _with(recording: Recording, change: Any) -> Recording:
    channel = recording.channels["sprung_accel"]
    moved = replace(channel, values=change(channel.time, channel.values))
    return replace(recording, channels={**recording.channels, "sprung_accel": moved})


def test_a_flank_shorter_than_the_time_between_samples_is_no_outlier(synthetic: Any) -> None:
    """Of 52 periods a few have a sample within half a millisecond of where a friction turns round."""
    rng = np.random.default_rng(9)
    signals = {
        "road_height": synthetic.road(rate=1000.0),
        "sprung_accel": synthetic.Signal(synthetic.stepped(2.0, 1), 1000.0, synthetic.white(0.001)),
    }

    def click(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        after = (6.6 * time - 0.31) % 0.5 / 6.6
        return values + 0.1 * np.maximum(1.0 - after / 6e-4, 0.0)

    def drop_out(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(np.arange(time.size) % 1000 == 130, values - 3.0, values)

    clicking = _with(synthetic.dwell(rng, signals, 6.6, 8.0), click)
    found = estimate_response(synthetic.campaign(clicking)).warnings
    assert not WARNED & {warning.code for warning in found}
    # Large ones that keep time with the drive, once a second, are a logger's.
    dropping = _with(synthetic.dwell(rng, signals, 5.0, 8.0), drop_out)
    found = estimate_response(synthetic.campaign(dropping)).warnings
    assert WARNED & {warning.code for warning in found}


@pytest.mark.parametrize(
    ("names", "share", "change"),
    [
        (("sprung_accel",), 0.002, spike),
        pytest.param(("sprung_accel",), 0.01, drop, marks=pytest.mark.slow),
        pytest.param(NAMES, 0.002, drop, marks=pytest.mark.slow),
        (NAMES, 0.01, spike),
    ],
)
def test_outliers_change_neither_noise_nor_harmonics(
    shipped: Campaign, clean: HarmonicResponse, change: Any, share: float, names: tuple[str, ...]
) -> None:
    rng = np.random.default_rng(17)
    campaign = corrupted(shipped, names, lambda values: change(values, share, rng))
    response = estimate_response(campaign)
    for name in names:
        c = clean.channel(name)
        np.testing.assert_allclose(response.noise_sd[:, c], clean.noise_sd[:, c], rtol=0.1)
        distance = error_in_sd(response, clean, name)
        assert np.quantile(distance, 0.9) < 1.0
        assert np.max(distance) < 3.0
    np.testing.assert_array_less(np.abs(response.frequency - clean.frequency), clean.frequency_sd)
    if share < 0.01:
        return
    before = plain_response(campaign)
    for name in names:
        c = clean.channel(name)
        assert np.median(before.noise_sd[:, c] / clean.noise_sd[:, c]) > 2.0, (
            "the plain fit took them for noise"
        )


def test_a_warning_says_where_how_many_and_what_it_means(shipped: Campaign) -> None:
    def three(values: NDArray[np.float64]) -> NDArray[np.float64]:
        bad = values.copy()
        bad[[40, 700, 701]] += np.ptp(values)
        return bad

    campaign = corrupted(shipped, ("sprung_accel",), three)
    found = [each for each in estimate_response(campaign).warnings if each.code in WARNED]
    dwell = campaign.of_kind("dwell")[0]
    channel = dwell.channels["sprung_accel"]
    assert [each.test for each in found] == [each.name for each in campaign.of_kind("dwell")]
    assert {each.code for each in found} == {"outlying_samples"}
    assert {each.channel for each in found} == {"sprung_accel"}
    assert f"3 of {channel.values.size} samples" in found[0].what
    assert "left out: harmonics and noise are those of the other samples" in found[0].what
    assert found[0].time == channel.time[40]
    assert found[0].remedy == "check the sensor's cable and the logger"


def test_the_warnings_reach_the_summary_and_the_origin_of_results(shipped: Campaign) -> None:
    rng = np.random.default_rng(2)
    campaign = corrupted(shipped, ("sprung_accel",), lambda values: spike(values, 0.002, rng))
    response = measured_response(campaign, load_model().plant, 9)
    found = [each for each in response.warnings if each.code in WARNED]
    assert len(found) == len(campaign.of_kind("dwell"))
    assert set(found) <= set(load_model().origin(campaign_of(campaign), response.warnings).warnings)
    assert set(found) <= set(inspect(campaign, orders=9).warnings)


def test_a_sensor_with_many_outliers_is_not_trusted(synthetic: Any) -> None:
    rng = np.random.default_rng(4)
    signals = {
        "road_height": synthetic.road(),
        "sprung_accel": synthetic.Signal(synthetic.stepped(2.0, 5), 250.0, synthetic.white(0.01)),
    }
    campaign = synthetic.campaign(synthetic.dwell(rng, signals, 2.1, 10.0))
    bad = corrupted(campaign, ("sprung_accel",), lambda values: spike(values, 0.08, rng))
    found = [each for each in estimate_response(bad).warnings if each.code in WARNED]
    assert [each.code for each in found] == ["unreliable_sensor"]
    assert "left out, but so many that the sensor cannot be trusted in this test" in found[0].what
    assert found[0].remedy.endswith("or leave this test out")


def test_too_many_outliers_are_not_left_out_but_warned_of(synthetic: Any) -> None:
    rng = np.random.default_rng(4)
    time = np.arange(1000) / 100.0
    residual = rng.standard_normal(time.size)
    residual[::4] += rng.choice([-30.0, 30.0], 250)
    samples = WaveformSamples(time, residual, 0.317 * time, 0.0)
    none = np.zeros(time.size, dtype=np.bool_)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outliers, "_recurs", lambda *_: False)
        patch.setattr(outliers, "_LONGEST_RUN", 1000)
        out = outliers.find_outliers(samples, residual, none, lambda mask: residual)
    assert np.mean(out) > outliers.MOST_LEFT_OUT
    recording = synthetic.dwell(rng, {"road_height": synthetic.road(rate=100.0)}, 1.0, 10.0)
    (warning,) = check_outliers("a.csv", recording, {"road_height": out})
    assert warning.code == "unreliable_sensor"
    assert "too many to leave out: the sensor cannot be trusted in this test" in warning.what


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.floats(0.0, 0.05),
    size=st.floats(-3.0, 3.0).map(lambda power: 10.0**power),
    periods=st.floats(3.2, 25.0),
    frequency=st.floats(0.6, 9.0),
)
def test_the_result_is_never_much_worse_than_the_plain_fit(
    synthetic: Any, seed: int, share: float, size: float, periods: float, frequency: float
) -> None:
    rng = np.random.default_rng(seed)
    truth = synthetic.stepped(2.0, 9)
    signals = {
        "road_height": synthetic.road(),
        "sprung_accel": synthetic.Signal(truth, 250.0, synthetic.white(0.02)),
    }
    recording = synthetic.dwell(rng, signals, frequency, periods / frequency)

    def add(channel: RecordedChannel) -> RecordedChannel:
        count = round(share * channel.values.size)
        places = rng.choice(channel.values.size, count, replace=False)
        values = channel.values.copy()
        values[places] += size * rng.standard_normal(count)
        return replace(channel, values=values)

    channels = {**recording.channels, "sprung_accel": add(recording.channels["sprung_accel"])}
    campaign = synthetic.campaign(replace(recording, channels=channels))
    robust, plain = estimate_response(campaign), plain_response(campaign)
    orders = slice(0, min(truth.size, int(0.4 * 250.0 / frequency) + 1))

    def error(response: HarmonicResponse) -> float:
        found = response.harmonics[0, response.channel("sprung_accel"), orders]
        return float(np.linalg.norm(found - truth[orders]))

    c = plain.channel("sprung_accel")
    chance = float(np.sqrt(np.sum(np.trace(robust.covariance[0, c, orders], axis1=-2, axis2=-1))))
    assert error(robust) <= 1.5 * error(plain) + 3.0 * chance
    assert robust.noise_sd[0, c] <= 1.05 * plain.noise_sd[0, c]
