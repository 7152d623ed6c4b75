"""Spikes and dropouts of a sweep: left out, said, and nothing else touched."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

import savgs_ident.responses.sweeps as sweeps
from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig import default_campaign_path
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.harmonic_response import SweepResponse
from savgs_ident.responses.sweep_phase import follow_input
from savgs_ident.responses.sweeps import estimate_sweep_response

from .corruption import drop, spike

Values = NDArray[np.float64]
NAMES = ("road_height", "sprung_accel", "susp_deflection")


def far_spike(values: Values, share: float, rng: np.random.Generator) -> Values:
    """A share of the samples replaced by values 50 standard deviations off the mean, either way."""
    bad = values.copy()
    places = rng.choice(values.size, round(share * values.size), replace=False)
    bad[places] = np.mean(values) + 50.0 * np.std(values) * rng.choice([-1.0, 1.0], places.size)
    return bad


def changed(recording: Recording, names: tuple[str, ...], change: Callable[[Values], Values]) -> Recording:
    """The recording with ``change`` applied to the values of some channels."""
    channels = {
        name: replace(channel, values=change(channel.values)) if name in names else channel
        for name, channel in recording.channels.items()
    }
    return replace(recording, channels=channels)


def plain_response(recording: Recording) -> SweepResponse:
    """The response with no sample left out."""

    def follow(test: str, road: RecordedChannel, *rest: object) -> object:
        return follow_input(test, road, *rest), np.zeros(road.values.size, dtype=np.bool_)  # type: ignore[arg-type]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweeps, "follow_input_robustly", follow)
        patch.setattr(
            sweeps, "find_channel_outliers", lambda channel, _: np.zeros(channel.values.size, dtype=np.bool_)
        )
        return estimate_sweep_response(recording, "road_height")


@pytest.fixture(scope="module")
def shipped() -> Recording:
    """Road and sensors of the shipped sweep, whose friction has steps that the local fits do not follow."""
    (recording,) = load_campaign(default_campaign_path()).of_kind("sweep")
    return replace(recording, channels={name: recording.channels[name] for name in NAMES})


@pytest.fixture(scope="module")
def clean(shipped: Recording) -> SweepResponse:
    """What is estimated from it."""
    return estimate_sweep_response(shipped, "road_height")


def stepped(noise: float, rate: float = 200.0, rest: float = 0.0) -> Recording:
    """A sweep of 0.4 to 3 Hz in 40 s after ``rest`` [s], and a sensor that a friction makes jump at reversals."""
    rng = np.random.default_rng(6)
    time = np.arange(round(rate * (40.0 + rest))) / rate
    moving = np.maximum(time - rest, 0.0)
    phase = 2.0 * np.pi * (0.4 * moving + 0.5 * 0.065 * moving**2)
    road = 0.014 * np.sin(phase)
    late = phase - 0.02 * phase / np.pi
    accel = 2.0 * np.sin(late) + 0.7 * np.sign(np.cos(late)) * (time > rest)
    return Recording(
        "sweep",
        "sweep",
        None,
        {
            "road_height": RecordedChannel(
                "road_height", "m", time, road + 1e-3 * noise * rng.standard_normal(time.size)
            ),
            "sprung_accel": RecordedChannel(
                "sprung_accel", "m/s^2", time, accel + noise * rng.standard_normal(time.size)
            ),
        },
    )


def test_a_clean_sweep_keeps_its_numbers_bit_by_bit(shipped: Recording, clean: SweepResponse) -> None:
    for robust, recording in (
        (clean, shipped),
        *((estimate_sweep_response(each, "road_height"), each) for each in (stepped(0.0), stepped(0.02))),
    ):
        plain = plain_response(recording)
        assert robust.warnings == plain.warnings == ()
        for name, value in vars(plain).items():
            other = getattr(robust, name)
            same = value.tobytes() == other.tobytes() if isinstance(value, np.ndarray) else value == other
            assert same, name


@pytest.mark.parametrize("change", [spike, far_spike, drop])
@pytest.mark.parametrize(
    "names",
    [
        pytest.param(("sprung_accel",), marks=pytest.mark.slow),
        pytest.param(("road_height",), marks=pytest.mark.slow),
        NAMES,
    ],
)
def test_outliers_do_not_change_the_response(
    shipped: Recording, clean: SweepResponse, change: Callable[..., Values], names: tuple[str, ...]
) -> None:
    bad = changed(shipped, names, partial(change, share=0.002, rng=np.random.default_rng(17)))
    response = estimate_sweep_response(bad, "road_height")
    np.testing.assert_allclose(response.time, clean.time, atol=1e-3)
    assert np.all(np.abs(response.frequency - clean.frequency) < clean.frequency_sd)
    error = np.abs(response.response - clean.response) / clean.response_sd
    assert np.quantile(error, 0.9) < 1.0
    assert np.all(np.abs(response.response - clean.response) < 5.0 * response.response_sd)
    assert np.median(response.response_sd / clean.response_sd) == pytest.approx(1.0, abs=0.05)
    assert {each.channel for each in response.warnings} == set(names)
    assert {each.code for each in response.warnings} == {"outlying_samples"}


def test_the_plain_response_is_spoilt_by_them(shipped: Recording, clean: SweepResponse) -> None:
    bad = changed(shipped, ("sprung_accel",), partial(spike, share=0.002, rng=np.random.default_rng(17)))
    c = clean.channel("sprung_accel")
    plain = plain_response(bad)
    assert np.median(plain.response_sd[:, c] / clean.response_sd[:, c]) > 3.0
    bad = changed(shipped, ("road_height",), partial(spike, share=0.002, rng=np.random.default_rng(17)))
    with pytest.raises(InputError, match="do not determine the phase of road_height"):
        plain_response(bad)


def test_a_warning_says_where_how_many_and_what_it_means(shipped: Recording) -> None:
    def three(values: Values) -> Values:
        bad = values.copy()
        bad[[9000, 14000, 14001]] += np.ptp(values)
        return bad

    response = estimate_sweep_response(
        changed(shipped, ("susp_deflection",), three), "road_height", source="a.csv"
    )
    (warning,) = response.warnings
    channel = shipped.channels["susp_deflection"]
    assert (warning.code, warning.source) == ("outlying_samples", "a.csv")
    assert (warning.test, warning.channel) == (shipped.name, "susp_deflection")
    assert f"3 of {channel.values.size} samples" in warning.what
    assert warning.time == channel.time[9000]


def test_spikes_before_the_road_moves_do_not_matter() -> None:
    recording = stepped(0.02, rest=8.0)
    clean = estimate_sweep_response(recording, "road_height")

    def early(values: Values) -> Values:
        bad = values.copy()
        bad[[100, 500, 900]] += np.array([0.01, -0.4, 0.4])
        bad[-3] += 0.3
        return bad

    response = estimate_sweep_response(changed(recording, ("road_height",), early), "road_height")
    np.testing.assert_allclose(response.response, clean.response, rtol=1e-4)
    assert [each.what.split()[:3] for each in response.warnings] == [["4", "of", "9600"]]


def test_windows_in_which_the_road_sticks_are_left_out() -> None:
    recording = stepped(0.02)
    clean = estimate_sweep_response(recording, "road_height")

    def stick(values: Values) -> Values:
        bad = values.copy()
        bad[4000:4120] = bad[4000]
        return bad

    response = estimate_sweep_response(changed(recording, ("road_height",), stick), "road_height")
    found = {each.code: each for each in response.warnings}
    assert "left out" in found["road_not_followed"].what
    assert np.all((response.time < 20.0) | (response.time > 20.6))
    before = response.time < 18.0
    np.testing.assert_allclose(response.response[before], clean.response[: before.sum()], rtol=1e-3)
    c = response.channel("sprung_accel")
    expected = np.interp(response.time, clean.time, np.abs(clean.response[:, c]))
    np.testing.assert_allclose(np.abs(response.response[:, c]), expected, rtol=0.01)


def test_a_road_of_which_a_third_is_wrong_is_refused() -> None:
    bad = changed(stepped(0.02), ("road_height",), partial(spike, share=0.3, rng=np.random.default_rng(1)))
    with pytest.raises(InputError, match=r"road.*Remedy"):
        estimate_sweep_response(bad, "road_height")


@pytest.mark.parametrize("size", [1e9, 1e100])
def test_the_size_of_a_spike_does_not_matter(size: float) -> None:
    recording = stepped(0.02)
    clean = estimate_sweep_response(recording, "road_height")

    def one(values: Values) -> Values:
        bad = values.copy()
        bad[4000] = size
        return bad

    response = estimate_sweep_response(changed(recording, tuple(recording.channels), one), "road_height")
    np.testing.assert_allclose(response.response, clean.response, rtol=2e-3)
    assert [each.channel for each in response.warnings] == list(recording.channels)
