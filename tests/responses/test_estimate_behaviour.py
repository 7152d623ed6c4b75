"""What a dwell's estimate does with clocks, time origins, scales, foldings and unusable input."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, signal_to_noise
from savgs_ident.responses.sweeps import estimate_sweep_response


def codes(response: HarmonicResponse) -> set[str]:
    return {warning.code for warning in response.warnings}


def change(recording: Recording, **by_name: Any) -> Recording:
    """The recording with a function applied to channels given by name."""
    channels = {
        name: by_name[name](channel) if name in by_name else channel
        for name, channel in recording.channels.items()
    }
    return replace(recording, channels=channels)


def chi_square(response: HarmonicResponse, channel: str, truth: Any) -> tuple[float, int]:
    """Sum over dwells and orders 1..n of the squared pulls against ``truth`` (n + 1,), and their number."""
    c = response.channel(channel)
    valid = response.valid[:, c, 1:] & (np.arange(1, response.orders + 1) < truth.size)
    full = np.zeros(response.orders + 1, dtype=np.complex128)
    full[: min(truth.size, full.size)] = truth[: full.size]
    error = response.harmonics[:, c, 1:] - full[1:]
    pulls = np.stack([error.real, error.imag], axis=-1)[valid]
    covariance = response.covariance[:, c, 1:][valid]
    distance = np.einsum("ki,ki->k", pulls, np.linalg.solve(covariance, pulls[..., None])[..., 0])
    return float(distance.sum()), 2 * int(np.count_nonzero(valid))


@pytest.fixture(scope="module")
def bus(synthetic: Any) -> dict[str, Any]:
    """Channels of a bus: own rates, own offsets."""
    return {
        "road_height": synthetic.road(1e-5, 50.0),
        "sprung_accel": synthetic.Signal(synthetic.stepped(2.0, 30), 200.0, synthetic.white(0.05), 0.37),
        "susp_deflection": synthetic.Signal(
            synthetic.stepped(0.01, 12, 7), 100.0, synthetic.white(1e-4), 0.81
        ),
    }


def test_channels_with_their_own_rates_and_phases_agree_with_the_truth(synthetic: Any, bus: Any) -> None:
    rng = np.random.default_rng(11)
    dwells = [synthetic.dwell(rng, bus, 2.347, 6.4, name=f"dwell_{i}", start=1.7e9) for i in range(60)]
    response = estimate_response(synthetic.campaign(*dwells))
    assert codes(response) == set()
    for name in ("sprung_accel", "susp_deflection"):
        total, count = chi_square(response, name, bus[name].harmonics)
        low, high = scipy.stats.chi2.ppf([1e-4, 1 - 1e-4], count)
        assert low < total < high
    highest = response.valid.sum(axis=2)[0] - 1
    assert dict(zip(response.channels, highest, strict=True)) == {
        "road_height": 8,
        "sprung_accel": 15,
        "susp_deflection": 15,
    }
    assert np.all(response.harmonics[:, 0, 1].imag == 0.0)
    assert np.all(response.harmonics[~response.valid] == 0.0)


def test_orders_above_the_nyquist_frequency_that_have_lines_of_their_own_do_no_harm(synthetic: Any) -> None:
    """Strong content up to 3 times the Nyquist frequency: orders and noise come out as without it."""
    harmonics = synthetic.stepped(30.0, 70)
    signals = {
        "road_height": synthetic.road(1e-8, 200.0),
        "sprung_accel": synthetic.Signal(harmonics, 200.0, synthetic.white(0.05)),
    }
    rng = np.random.default_rng(12)
    dwells = [synthetic.dwell(rng, signals, 4.4, 6.4, name=f"dwell_{i}", jitter=0.0) for i in range(30)]
    response = estimate_response(synthetic.campaign(*dwells))
    assert float(response.noise_sd[:, 1].mean()) == pytest.approx(0.05, rel=0.03)
    total, count = chi_square(response, "sprung_accel", harmonics)
    low, high = scipy.stats.chi2.ppf([1e-4, 1 - 1e-4], count)
    assert low < total < high


def test_the_time_of_each_dwell_is_its_start_or_its_place_in_the_campaign(synthetic: Any, bus: Any) -> None:
    """Dwells are sorted by frequency, but not their times."""
    rng = np.random.default_rng(21)
    dwells = [synthetic.dwell(rng, bus, f, 6.4, name=f"dwell_{f}Hz") for f in (3.0, 2.0, 4.0)]
    undated = [replace(each, start=None) for each in dwells]
    dated = [replace(each, start=start) for each, start in zip(dwells, (60.0, 200.0, 20.0), strict=True)]
    assert estimate_response(synthetic.campaign(*undated)).recorded == pytest.approx([1.0, 0.0, 2.0])
    assert estimate_response(synthetic.campaign(*dated)).recorded == pytest.approx([200.0, 60.0, 20.0])
    partly = estimate_response(synthetic.campaign(dated[0], *undated[1:]))
    assert partly.recorded == pytest.approx([1.0, 0.0, 2.0])


def test_what_cannot_be_unfolded_is_in_the_covariance(synthetic: Any) -> None:
    """At 5 Hz and 100 Hz, order 20 - k folds onto order k, exactly: the error is covered, and said."""
    harmonics = synthetic.stepped(10.0, 40)
    signals = {
        "road_height": synthetic.road(1e-8, 100.0),
        "sprung_accel": synthetic.Signal(harmonics, 100.0, synthetic.white(0.01)),
    }
    rng = np.random.default_rng(13)
    dwells = [synthetic.dwell(rng, signals, 5.0, 8.0, name=f"dwell_{i}", jitter=0.0) for i in range(30)]
    response = estimate_response(synthetic.campaign(*dwells), orders=8)
    assert "folded_orders" in codes(response)
    total, count = chi_square(response, "sprung_accel", harmonics)
    assert total / count < 3.0
    noise_alone = 4.0 * response.noise_sd[:, 1] ** 2 / 800
    error = np.abs(response.harmonics[:, 1, 1:9] - harmonics[1:9]) ** 2
    assert np.mean(error) / np.mean(noise_alone) > 100.0


def test_moving_the_clock_changes_nothing(synthetic: Any, bus: Any) -> None:
    rng = np.random.default_rng(14)
    before = synthetic.dwell(rng, bus, 1.4, 7.3)

    def later(channel: RecordedChannel) -> RecordedChannel:
        return replace(channel, time=channel.time + 512.0)

    after = change(before, **dict.fromkeys(bus, later))
    one, other = (estimate_response(synthetic.campaign(dwell)) for dwell in (before, after))
    assert other.frequency == pytest.approx(one.frequency, rel=1e-9)
    deviation = np.sqrt(np.trace(one.covariance, axis1=-2, axis2=-1))
    assert np.all(np.abs(other.harmonics - one.harmonics) <= 1e-3 * deviation)
    np.testing.assert_allclose(other.peak_to_peak, one.peak_to_peak, rtol=1e-6)


def test_starting_the_record_later_in_the_cycle_keeps_the_harmonics(synthetic: Any) -> None:
    """Noise-free: the same waveform recorded from different cam angles has the same harmonics."""
    harmonics = synthetic.stepped(2.0, 20)
    signals = {
        "road_height": synthetic.road(0.0),
        "sprung_accel": synthetic.Signal(harmonics, 250.0, synthetic.white(0.0)),
    }
    rng = np.random.default_rng(15)
    dwells = [synthetic.dwell(rng, signals, 1.85, 6.49, name=f"dwell_{i}") for i in range(8)]
    response = estimate_response(synthetic.campaign(*dwells))
    assert response.frequency == pytest.approx(1.85, rel=1e-11)
    np.testing.assert_allclose(response.harmonics[:, 1], np.tile(harmonics[:16], (8, 1)), atol=1e-9)


@given(scale=st.floats(1e-6, 1e6), sign=st.sampled_from([-1.0, 1.0]), tempo=st.floats(0.05, 20.0))
def test_scales_carry_through(synthetic: Any, scale: float, sign: float, tempo: float) -> None:
    """Another unit scales harmonics, covariance and peak-to-peak; another time unit scales the frequency."""
    rng = np.random.default_rng(16)
    signals = {
        "road_height": synthetic.road(),
        "sprung_accel": synthetic.Signal(synthetic.stepped(2.0, 20), 250.0, synthetic.white(0.05)),
    }
    plain = synthetic.dwell(rng, signals, 2.2, 5.1)
    scaled = change(
        plain,
        road_height=lambda c: replace(c, time=c.time * tempo),
        sprung_accel=lambda c: replace(c, time=c.time * tempo, values=c.values * sign * scale),
    )
    scaled = replace(scaled, frequency_hz=2.2 / tempo)
    one, other = (estimate_response(synthetic.campaign(dwell), orders=7) for dwell in (plain, scaled))
    assert other.frequency * tempo == pytest.approx(one.frequency, rel=1e-9)
    size = np.abs(one.harmonics[0, 1]).max()
    np.testing.assert_allclose(other.harmonics[0, 1] / (sign * scale), one.harmonics[0, 1], atol=1e-7 * size)
    np.testing.assert_allclose(
        np.trace(other.covariance[0, 1], axis1=-2, axis2=-1) / scale**2,
        np.trace(one.covariance[0, 1], axis1=-2, axis2=-1),
        rtol=1e-3,
    )
    assert other.noise_sd[0, 1] / scale == pytest.approx(one.noise_sd[0, 1], rel=1e-5)


def test_a_clock_that_runs_slow_is_found_and_mended(synthetic: Any, bus: Any) -> None:
    slow = {**bus, "sprung_accel": replace(bus["sprung_accel"], clock=1.0 + 300e-6)}
    rng = np.random.default_rng(17)
    dwells = [synthetic.dwell(rng, slow, f, 6.4, name=f"dwell_{f}") for f in (1.4, 2.3, 3.1, 4.3)]
    response = estimate_response(synthetic.campaign(*dwells))
    (warning,) = [w for w in response.warnings if w.code == "clock_rate_differs"]
    assert warning.channel == "sprung_accel"
    assert "slower" in warning.what
    ppm = float(warning.what.split("runs ")[1].split(" ppm")[0])
    deviation = float(warning.what.split("(+- ")[1].split(")")[0])
    assert abs(ppm - 300.0) < 4.0 * deviation


def test_a_third_without_samples_is_left_out_not_interpolated(synthetic: Any, bus: Any) -> None:
    def holed(channel: RecordedChannel) -> RecordedChannel:
        values = channel.values.copy()
        values[values.size // 4 : values.size // 2] = np.nan
        return replace(channel, values=values)

    rng = np.random.default_rng(18)
    dwells = [
        change(synthetic.dwell(rng, bus, 2.347, 9.4, name=f"dwell_{i}"), sprung_accel=holed)
        for i in range(20)
    ]
    response = estimate_response(synthetic.campaign(*dwells), orders=9)
    total, count = chi_square(response, "sprung_accel", bus["sprung_accel"].harmonics)
    low, high = scipy.stats.chi2.ppf([1e-4, 1 - 1e-4], count)
    assert low < total < high


def test_coarse_steps_of_a_sensor_do_not_vanish_from_the_covariance(synthetic: Any) -> None:
    """Periods of a whole number of samples repeat the rounding error: nothing is left between the lines."""
    harmonics = synthetic.stepped(2.0, 3)
    signals = {
        "road_height": synthetic.road(0.0),
        "sprung_accel": synthetic.Signal(harmonics, 250.0, synthetic.white(0.0)),
    }
    exact = synthetic.dwell(np.random.default_rng(19), signals, 2.5, 8.0, jitter=0.0)
    step = 0.05
    rounded = change(exact, sprung_accel=lambda c: replace(c, values=np.round(c.values / step) * step))
    response = estimate_response(synthetic.campaign(rounded), orders=3)
    assert response.noise_sd[0, 1] == pytest.approx(step / np.sqrt(12.0), rel=1e-6)
    error = np.abs(response.harmonics[0, 1, 1:] - harmonics[1:4])
    assert np.all(error < 10.0 * np.sqrt(np.trace(response.covariance[0, 1, 1:], axis1=-2, axis2=-1)))


def test_a_decaying_dwell_is_called_unsteady(synthetic: Any, bus: Any) -> None:
    dwell = synthetic.dwell(np.random.default_rng(20), bus, 2.2, 6.4)

    def decaying(channel: RecordedChannel) -> RecordedChannel:
        return replace(channel, values=channel.values * np.exp(-channel.time / 20.0))

    response = estimate_response(synthetic.campaign(change(dwell, sprung_accel=decaying)))
    found = [w for w in response.warnings if w.code == "not_steady"]
    assert [w.channel for w in found] == ["sprung_accel"]
    assert found[0].remedy


def test_a_gap_at_one_end_is_no_change(synthetic: Any, bus: Any) -> None:
    dwell = synthetic.dwell(np.random.default_rng(20), bus, 2.2, 6.4)

    def with_gap(channel: RecordedChannel) -> RecordedChannel:
        missing = (channel.time > 1.0) & (channel.time < 1.15)
        return replace(channel, values=np.where(missing, np.nan, channel.values))

    for name in dwell.channels:
        response = estimate_response(synthetic.campaign(change(dwell, **{name: with_gap})))
        assert "not_steady" not in {warning.code for warning in response.warnings}


def test_noise_far_above_standstill_is_reported(synthetic: Any, bus: Any) -> None:
    rng = np.random.default_rng(21)
    dwell = synthetic.dwell(rng, bus, 2.2, 6.4, name="dwell_a")
    time = np.arange(2000) / 200.0
    quiet = RecordedChannel("sprung_accel", "m/s^2", time, 0.02 * rng.standard_normal(time.size))
    still = Recording("standstill", "standstill", None, {"sprung_accel": quiet})
    response = estimate_response(synthetic.campaign(dwell, still))
    (warning,) = [w for w in response.warnings if w.code == "noise_above_standstill"]
    assert (warning.channel, warning.test) == ("sprung_accel", "dwell_a")
    same = RecordedChannel("sprung_accel", "m/s^2", time, 0.05 * rng.standard_normal(time.size))
    calm = Recording("standstill", "standstill", None, {"sprung_accel": same})
    assert codes(estimate_response(synthetic.campaign(dwell, calm))) == set()


def test_a_wrong_label_is_reported_and_the_measured_frequency_used(synthetic: Any, bus: Any) -> None:
    dwell = replace(synthetic.dwell(np.random.default_rng(22), bus, 2.2, 6.4), frequency_hz=2.5)
    response = estimate_response(synthetic.campaign(dwell))
    assert codes(response) == {"frequency_differs"}
    assert float(response.frequency[0]) == pytest.approx(2.2, abs=1e-4)


def test_unusable_dwells_are_named_and_the_others_kept(synthetic: Any, bus: Any) -> None:
    rng = np.random.default_rng(23)
    good = synthetic.dwell(rng, bus, 2.2, 6.4, name="good")
    short = synthetic.dwell(rng, bus, 0.5, 4.0, name="short")
    dead = change(
        synthetic.dwell(rng, bus, 2.2, 6.4, name="dead"),
        road_height=lambda c: replace(c, values=np.zeros_like(c.values)),
    )
    noisy = change(
        synthetic.dwell(rng, bus, 2.2, 6.4, name="noisy"),
        road_height=lambda c: replace(c, values=1e-5 * rng.standard_normal(c.values.size)),
    )
    whole = synthetic.dwell(rng, bus, 2.2, 6.4, name="blind")
    blind = replace(whole, channels={k: v for k, v in whole.channels.items() if k != "road_height"})
    response = estimate_response(synthetic.campaign(short, good, dead, noisy, blind))
    assert response.tests == ("good",)
    found = {(w.test, w.code) for w in response.warnings}
    still = {(name, "no_road_motion") for name in ("dead", "noisy", "blind")}
    assert found == {("short", "too_few_periods"), *still}
    assert all(w.remedy for w in response.warnings)


def test_findings_name_the_input_that_is_driven(synthetic: Any, bus: Any) -> None:
    """The code of the road is its own; other inputs share one."""
    good = synthetic.dwell(np.random.default_rng(27), bus, 2.2, 6.4, name="good")
    still = change(good, road_height=lambda c: replace(c, values=np.zeros_like(c.values)))
    for driven, code in (("road_height", "no_road_motion"), ("drive_force", "no_input_motion")):
        each, other = (_renamed(dwell, driven) for dwell in (good, replace(still, name="dead")))
        (warning,) = estimate_response(synthetic.campaign(each, other), driven=driven).warnings
        assert (warning.test, warning.code, warning.channel) == ("dead", code, driven)
        assert warning.what == f"{driven} does not move"
        with pytest.raises(InputError, match=f"no motion of {driven} to refer to"):
            estimate_sweep_response(other, driven)


def _renamed(dwell: Recording, driven: str) -> Recording:
    """The dwell with the road's channel under another name."""
    names = {"road_height": driven}
    channels = {names.get(name, name): each for name, each in dwell.channels.items()}
    return replace(dwell, channels={name: replace(each, name=name) for name, each in channels.items()})


@pytest.mark.parametrize("which", ["none", "short"])
def test_no_usable_dwell_is_an_input_error(synthetic: Any, bus: Any, which: str) -> None:
    short = synthetic.dwell(np.random.default_rng(24), bus, 0.5, 4.0, name="short")
    dwells = {"none": (), "short": (short,)}[which]
    with pytest.raises(InputError, match=r"Remedy: .+") as caught:
        estimate_response(Campaign("here.csv", dwells, (), "", RIG_LAYOUT))
    assert caught.value.source == "here.csv"


def test_orders_below_one_are_refused(synthetic: Any, bus: Any) -> None:
    dwell = synthetic.dwell(np.random.default_rng(25), bus, 2.2, 6.4)
    with pytest.raises(InputError, match="orders is 0"):
        estimate_response(synthetic.campaign(dwell), orders=0)


def test_dwells_are_sorted_and_the_signal_to_noise_is_as_designed(synthetic: Any, bus: Any) -> None:
    rng = np.random.default_rng(26)
    dwells = [synthetic.dwell(rng, bus, f, 6.4, name=f"dwell_{f}") for f in (3.3, 1.1, 2.2)]
    response = estimate_response(synthetic.campaign(*dwells))
    assert response.tests == ("dwell_1.1", "dwell_2.2", "dwell_3.3")
    assert response.periods.tolist() == [7, 14, 21]
    ratio = signal_to_noise(response)
    expected = 2.0 / (0.05 * np.sqrt(4.0 / (6.4 * 200.0)))
    assert ratio[:, response.channel("sprung_accel"), 1] == pytest.approx(expected, rel=0.25)
    assert np.all(ratio[~response.valid] == 0.0)


def test_a_dwell_that_rings_at_another_frequency_at_first_is_called_unsteady(
    synthetic: Any, bus: Any
) -> None:
    """As one that begins at rest does: the fundamental is what it is, and S/N alone falls."""
    dwell = synthetic.dwell(np.random.default_rng(23), bus, 2.2, 6.4)

    def ringing(size: float) -> Callable[[RecordedChannel], RecordedChannel]:
        def with_ringing(channel: RecordedChannel) -> RecordedChannel:
            ring = np.exp(-channel.time / 0.8) * np.sin(2.0 * np.pi * 1.37 * channel.time)
            return replace(channel, values=channel.values + size * np.ptp(channel.values) * ring)

        return with_ringing

    def unsteady(size: float) -> list[str]:
        rung = change(dwell, sprung_accel=ringing(size))
        found = estimate_response(synthetic.campaign(rung)).warnings
        return [
            each.channel for each in found if each.code == "not_steady" and "does not repeat" in each.what
        ]

    assert unsteady(0.4) == ["sprung_accel"]
    assert unsteady(0.001) == unsteady(0.0) == []
