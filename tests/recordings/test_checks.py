"""What the checks find in a campaign that can be read, and that they stay silent where nothing is wrong."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.recordings.checks import check_test, measure_frequency
from savgs_ident.recordings.checks_signal import DataLocation, check_clipping
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording

Signals = dict[str, NDArray[np.float64]]
Change = Callable[[Signals], Signals]


@pytest.fixture
def read(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> Callable[..., Campaign]:
    """Read a 1 Hz dwell after a change of its signals or of its text."""

    def build(
        change: Change = dict, text: Callable[[bytes], bytes] = bytes, name: str = "dwell_1Hz.csv"
    ) -> Campaign:
        path = tmp_path / name
        path.write_bytes(text(csv_bytes(change(signals()))))
        return load_campaign(path)

    return build


def _where(channel: str, where: Any, value: float) -> Change:
    def change(signals: Signals) -> Signals:
        column = signals[channel].copy()
        column[where] = value
        return signals | {channel: column}

    return change


def _jump(signals: Signals) -> Signals:
    return signals | {"time": signals["time"] + np.where(np.arange(1000) < 500, 0.0, 0.2)}


def _repeat(signals: Signals) -> Signals:
    time = signals["time"].copy()
    time[[100, 200]] = time[[99, 199]]
    return signals | {"time": time}


def _clip(signals: Signals) -> Signals:
    return signals | {"sprung_accel": np.minimum(signals["sprung_accel"], 0.35)}


def _times(channel: str, factor: float) -> Change:
    return lambda signals: signals | {channel: factor * signals[channel]}


def _short(signals: Signals) -> Signals:
    return {name: values[:450] for name, values in signals.items()}


def _slow(signals: Signals) -> Signals:
    return {name: values[::30] for name, values in signals.items()}


WARNINGS: dict[str, tuple[Change, str, str, float | None, str]] = {
    "few missing": (
        _where("sprung_accel", slice(300, 303), np.nan),
        "missing_samples",
        "sprung_accel",
        3.0,
        "3 of",
    ),
    "one huge value": (
        _where("sprung_accel", 300, -1e9),
        "impossible_samples",
        "sprung_accel",
        3.0,
        "1 of 1000 samples.*up to 1e+09 m/s^2.*left out",
    ),
    "two infinite values": (
        _where("road_height", [300, 700], np.inf),
        "impossible_samples",
        "road_height",
        3.0,
        "2 of 1000 samples.*up to inf m",
    ),
    "a deflection longer than the strut": (
        _where("susp_deflection", slice(300, 303), 0.6),
        "impossible_samples",
        "susp_deflection",
        3.0,
        "3 of 1000 samples.*up to 0.6 m",
    ),
    "small jump": (_jump, "time_jump", "road_height", 4.99, "by 0.21 s"),
    "repeated stamps": (_repeat, "repeated_time", "road_height", 0.99, "2 samples repeat"),
    "clipped": (_clip, "clipped_sensor", "sprung_accel", None, "upper end 0.35"),
    "stuck response": (
        _where("sprung_accel", slice(0, 400), 0.1),
        "stuck_sensor",
        "sprung_accel",
        0.0,
        "one value",
    ),
    "empty response": (
        _where("sprung_accel", slice(None), np.nan),
        "empty_channel",
        "sprung_accel",
        None,
        "no value",
    ),
    "few periods": (_short, "few_periods", "", None, "4.5 periods"),
    "few samples a period": (_slow, "undersampled", "sprung_accel", None, "3.3 samples"),
    "g called m/s^2": (
        _times("sprung_accel", 1 / 9.80665),
        "implausible_unit",
        "sprung_accel",
        None,
        "g or m/s",
    ),
    "m called mm": (_times("susp_deflection", 1e-3), "implausible_unit", "susp_deflection", None, "mm or m"),
    "deflection upside down": (
        _times("susp_deflection", -1),
        "sign_suspect",
        "susp_deflection",
        None,
        "bump",
    ),
    "road upside down": (_times("road_height", -1), "sign_suspect", "sprung_accel", None, "opposed"),
    "wrong frequency": (_times("time", 0.5), "frequency_mismatch", "road_height", None, "at 2 Hz.*at 1 Hz"),
}


@pytest.mark.parametrize("case", WARNINGS)
def test_a_fault_is_named_with_its_place(case: str, read: Callable[..., Campaign]) -> None:
    change, code, channel, time, text = WARNINGS[case]
    campaign = read(change)
    found = [w for w in campaign.warnings if (w.code, w.channel) == (code, channel)]
    assert len(found) == 1, [str(w) for w in campaign.warnings]
    (warning,) = found
    assert time is None or warning.time == pytest.approx(time)
    assert warning.remedy
    assert warning.source.endswith("dwell_1Hz.csv")
    assert all(part in str(warning) for part in text.split(".*"))


def test_missing_and_repeated_samples_are_gone(
    read: Callable[..., Campaign], signals: Callable[..., Signals]
) -> None:
    channel = read(_where("sprung_accel", slice(300, 303), np.nan)).recordings[0].channels["sprung_accel"]
    np.testing.assert_array_equal(channel.values, np.delete(signals()["sprung_accel"], [300, 301, 302]))
    np.testing.assert_allclose(channel.time, np.delete(signals()["time"], [300, 301, 302]))
    assert read(_repeat).recordings[0].channels["sprung_accel"].values.size == 998


def test_a_few_impossible_samples_are_gone_and_nothing_else(
    read: Callable[..., Campaign], signals: Callable[..., Signals]
) -> None:
    def change(signals: Signals) -> Signals:
        faulty = _where("sprung_accel", 300, np.inf)(signals)
        return _where("susp_deflection", [500, 700], 1e9)(faulty)

    campaign = read(change)
    channels = campaign.recordings[0].channels
    np.testing.assert_array_equal(channels["road_height"].values, signals()["road_height"])
    np.testing.assert_array_equal(channels["sprung_accel"].values, np.delete(signals()["sprung_accel"], 300))
    np.testing.assert_array_equal(
        channels["susp_deflection"].values, np.delete(signals()["susp_deflection"], [500, 700])
    )
    np.testing.assert_allclose(channels["susp_deflection"].time, np.delete(signals()["time"], [500, 700]))
    assert [w.code for w in campaign.warnings] == ["impossible_samples"] * 2


def test_a_slower_sensor_may_have_an_impossible_sample(read: Callable[..., Campaign]) -> None:
    slower = _where("susp_deflection", np.arange(1000) % 5 != 2, np.nan)
    campaign = read(lambda signals: _where("susp_deflection", 502, np.inf)(slower(signals)))
    assert [w.code for w in campaign.warnings] == ["impossible_samples"]
    assert campaign.recordings[0].channels["susp_deflection"].values.size == 199


SPIKES = {"road_height": 0.4, "sprung_accel": 100.0, "susp_deflection": 0.4}
"""Sizes of spikes that are possible, in SI units: tens of standard deviations."""


def _spiked(signals: Signals) -> Signals:
    random = np.random.default_rng(2)
    for name, size in SPIKES.items():
        for sign in (-1.0, 1.0):
            signals = _where(name, random.choice(1000, 3, replace=False), sign * size)(signals)
    return signals


def test_spikes_are_no_other_unit_and_no_other_sign(read: Callable[..., Campaign]) -> None:
    assert read(_spiked).warnings == ()


@pytest.mark.parametrize(
    "case", ["g called m/s^2", "m called mm", "deflection upside down", "road upside down", "clipped"]
)
def test_spikes_do_not_hide_another_fault(case: str, read: Callable[..., Campaign]) -> None:
    change, code, channel, _, _ = WARNINGS[case]
    found = read(lambda signals: _spiked(change(signals))).warnings
    assert [(w.code, w.channel) for w in found] == [(code, channel)]


def test_a_stuck_response_is_left_out_and_the_other_kept(read: Callable[..., Campaign]) -> None:
    (recording,) = read(_where("sprung_accel", slice(0, 400), 0.1)).recordings
    assert "sprung_accel" not in recording.channels
    assert "susp_deflection" in recording.channels


def test_a_slower_sensor_in_a_faster_table_is_no_fault(read: Callable[..., Campaign]) -> None:
    mask = np.arange(1000) % 5 != 2
    campaign = read(_where("susp_deflection", mask, np.nan))
    assert campaign.warnings == ()
    assert campaign.recordings[0].channels["susp_deflection"].rate_hz == pytest.approx(20.0)


def test_gravity_and_bias_are_taken_off_by_the_standstill(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    still = {n: np.zeros(1000) if n != "time" else t for n, t in signals().items()}
    for folder, both in (("with", True), ("without", False)):
        (tmp_path / folder).mkdir()
        dwell = signals() | {"sprung_accel": signals()["sprung_accel"] + 9.9}
        (tmp_path / folder / "dwell_1Hz.csv").write_bytes(csv_bytes(dwell))
        if both:
            text = csv_bytes(still | {"sprung_accel": np.full(1000, 9.9)})
            (tmp_path / folder / "standstill.csv").write_bytes(text)
    known, unknown = load_campaign(tmp_path / "with"), load_campaign(tmp_path / "without")
    assert [w.code for w in (*known.warnings, *unknown.warnings)] == ["gravity_removed"] * 2
    values = signals()["sprung_accel"]
    np.testing.assert_allclose(known.recordings[0].channels["sprung_accel"].values, values, atol=1e-9)
    np.testing.assert_allclose(
        unknown.recordings[0].channels["sprung_accel"].values, values + 9.9 - 9.80665, atol=1e-9
    )


def test_a_spike_at_rest_moves_neither_bias_nor_standstill(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    random = np.random.default_rng(1)
    noise = 0.05 * random.standard_normal(1000)
    still = signals() | {
        "road_height": 1e-5 * random.standard_normal(1000),
        "sprung_accel": 9.9 + noise,
        "susp_deflection": np.zeros(1000),
    }
    spiked = _where("road_height", 400, 0.4)(_where("sprung_accel", 500, 250.0)(still))
    dwell = signals() | {"sprung_accel": signals()["sprung_accel"] + 9.9}
    (tmp_path / "dwell_1Hz.csv").write_bytes(csv_bytes(dwell))
    (tmp_path / "standstill.csv").write_bytes(csv_bytes(spiked))
    campaign = load_campaign(tmp_path)
    assert [w.code for w in campaign.warnings] == ["gravity_removed"]
    bias = float(np.mean(np.delete(noise, 500)))
    np.testing.assert_allclose(
        campaign.recordings[0].channels["sprung_accel"].values,
        signals()["sprung_accel"] - bias,
        atol=1e-9,
    )


def test_one_bad_test_costs_that_test(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    good, bad = csv_bytes(signals(), test="dwell_1Hz"), csv_bytes(signals(2.0, 1.0), test="dwell_2Hz")
    (tmp_path / "a.csv").write_bytes(good + bad.split(b"\n", 1)[1])
    campaign = load_campaign(tmp_path / "a.csv")
    assert [r.name for r in campaign.recordings] == ["dwell_1Hz"]
    assert [(w.code, w.test) for w in campaign.warnings] == [("test_left_out", "dwell_2Hz")]
    assert "2.0 periods" in campaign.warnings[0].what


def test_repeated_tests_are_kept_apart(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    one, two = (
        csv_bytes(signals(), test="dwell_1Hz"),
        csv_bytes(signals(2.0), test="dwell_2Hz").split(b"\n", 1)[1],
    )
    (tmp_path / "a.csv").write_bytes(one + two + one.split(b"\n", 1)[1])
    campaign = load_campaign(tmp_path / "a.csv")
    assert [r.name for r in campaign.recordings] == ["dwell_1Hz", "dwell_2Hz", "dwell_1Hz#2"]
    assert [w.code for w in campaign.warnings] == ["repeated_test"]


def test_a_moving_standstill_and_an_unknown_kind(read: Callable[..., Campaign]) -> None:
    assert [w.code for w in read(name="standstill.csv").warnings] == ["standstill_moves"]
    assert [w.code for w in read(name="monday.csv").warnings] == ["test_kind_unknown"]


def test_a_cut_gzip_gives_its_whole_lines(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    path = tmp_path / "dwell_1Hz.csv.gz"
    packed = gzip.compress(csv_bytes(signals(seconds=60.0)))
    path.write_bytes(packed[: len(packed) // 2])
    campaign = load_campaign(path)
    channel = campaign.recordings[0].channels["sprung_accel"]
    assert [w.code for w in campaign.warnings] == ["truncated_file"]
    assert campaign.warnings[0].time == channel.time[-1]
    np.testing.assert_array_equal(
        channel.values, signals(seconds=60.0)["sprung_accel"][: channel.values.size]
    )
    assert 2000 < channel.values.size < 4000


def test_a_last_line_without_its_end_may_be_cut(read: Callable[..., Campaign]) -> None:
    campaign = read(text=lambda text: text[:-3])
    assert [w.code for w in campaign.warnings] == ["unfinished_line"]
    assert campaign.recordings[0].channels["road_height"].values.size == 999


def _tone(values: NDArray[np.float64], name: str = "a") -> Recording:
    time = np.arange(values.size) / 500.0
    return Recording(
        name, "dwell", 1.0, {"sprung_accel": RecordedChannel("sprung_accel", "m/s^2", time, values)}
    )


@given(
    quantum=st.floats(1e-5, 0.2),
    offset=st.floats(0.0, 1.0),
    cycles=st.floats(3.0, 40.0),
    noise=st.sampled_from([0.0, 1e-3, 0.05]),
)
def test_a_quantised_sinusoid_is_not_called_clipped(
    quantum: float, offset: float, cycles: float, noise: float
) -> None:
    random = np.random.default_rng(3)
    tone = np.sin(2 * np.pi * cycles * np.arange(4000) / 4000 + 6 * offset) + noise * random.standard_normal(
        4000
    )
    assert check_clipping([_tone(quantum * np.round(tone / quantum + offset))], "a") == ()


@given(level=st.floats(0.5, 0.95), noise=st.sampled_from([0.0, 0.02]), cycles=st.integers(4, 20))
def test_a_clipped_sinusoid_is_called_clipped(level: float, noise: float, cycles: int) -> None:
    random = np.random.default_rng(3)
    tone = np.sin(2 * np.pi * cycles * np.arange(4000) / 4000.3) + noise * random.standard_normal(4000)
    found = check_clipping([_tone(np.round(np.minimum(tone, level), 6))], "a")
    assert [w.code for w in found] == ["clipped_sensor"]
    assert "upper end" in found[0].what


def test_an_end_that_another_test_exceeds_is_no_end_of_range() -> None:
    tone = np.sin(2 * np.pi * 8.0 * np.arange(4000) / 4000)
    flat = _tone(np.minimum(tone, 0.7))
    assert len(check_clipping([flat], "a")) == 1
    assert check_clipping([flat, _tone(tone, "b")], "a") == ()


@given(frequency=st.floats(0.5, 6.0), phase=st.floats(0.0, 6.28))
def test_the_frequency_of_the_road_is_measured(frequency: float, phase: float) -> None:
    time = np.arange(500) / 50.0
    road = RecordedChannel(
        "road_height", "m", time, 0.014 * np.sin(2 * np.pi * frequency * time + phase) + 0.002
    )
    assert measure_frequency(road) == pytest.approx(frequency, rel=0.02)


def test_spikes_of_the_road_are_no_other_frequency() -> None:
    time = np.arange(4000) / 250.0
    values = 0.014 * np.sin(2 * np.pi * 1.5 * time)
    values[[200, 700, 1300, 1301, 2100, 3000]] += 0.04
    values[[500, 900, 2500, 3500]] -= 0.04
    road = RecordedChannel("road_height", "m", time, values)
    for said, codes in ((1.5, []), (1.8, ["frequency_mismatch"])):
        recording = Recording("dwell", "dwell", said, {"road_height": road})
        found = check_test(recording, RIG_LAYOUT, DataLocation("a.csv", "dwell"))
        assert [warning.code for warning in found] == codes


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (7.0, "")])
def test_a_time_in_another_unit_is_named_by_how_far_the_frequency_is_off(factor: float, unit: str) -> None:
    time = np.arange(8000) / 4000.0
    road = RecordedChannel("road_height", "m", factor * time, 1e-4 * np.sin(2 * np.pi * 25.0 * time))
    recording = Recording("dwell_25Hz", "dwell", 25.0, {"road_height": road})
    found = check_test(recording, RIG_LAYOUT, DataLocation("a.csv", "dwell_25Hz"))
    (said,) = (each.what for each in found if each.code == "frequency_mismatch")
    assert (f"as if its time were in {unit} " in said) if unit else "as if" not in said


@pytest.mark.parametrize("condition", ["nominal", "stribeck_rail", "mount_compliance", "accel_lag"])
def test_nothing_is_wrong_with_a_sound_campaign(condition: str, shared_rig: Path) -> None:
    campaign = load_campaign(shared_rig / condition / "campaign.csv.gz")
    assert campaign.warnings == ()
    assert len(campaign.of_kind("dwell")) == 28
    assert len(campaign.of_kind("sweep")) == len(campaign.of_kind("standstill")) == 1
