"""Every kind of broken table gives an error that says what, where and what to do."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign

from ..in_one_test import over
from .refusal import check_refusal

Signals = dict[str, NDArray[np.float64]]
Build = Callable[[Signals, Callable[..., bytes]], bytes]


def _edit(channel: str, where: slice | int, value: float) -> Build:
    def build(signals: Signals, csv: Callable[..., bytes]) -> bytes:
        column = signals[channel].copy()
        column[where] = value
        return csv(signals | {channel: column})

    return build


def _scaled(channel: str, factor: float) -> Build:
    return lambda signals, csv: csv(signals | {channel: signals[channel] * factor})


def _without(*channels: str) -> Build:
    return lambda signals, csv: csv({name: v for name, v in signals.items() if name not in channels})


def _replaced(old: bytes, new: bytes) -> Build:
    return lambda signals, csv: csv(signals).replace(old, new, 1)


def _line(number: int, change: Callable[[bytes], bytes]) -> Build:
    def build(signals: Signals, csv: Callable[..., bytes]) -> bytes:
        lines = csv(signals).split(b"\n")
        lines[number] = change(lines[number])
        return b"\n".join(lines)

    return build


def _cut(seconds: float) -> Build:
    return lambda signals, csv: csv({n: v[signals["time"] < seconds] for n, v in signals.items()})


def _backwards(signals: Signals, csv: Callable[..., bytes]) -> bytes:
    time = signals["time"].copy()
    time[500:] -= 2.0
    return csv(signals | {"time": time})


def _gap(signals: Signals, csv: Callable[..., bytes]) -> bytes:
    time = signals["time"].copy()
    time[500:] += 4.0
    return csv(signals | {"time": time})


def _coarse_time(signals: Signals, csv: Callable[..., bytes]) -> bytes:
    return csv(signals | {"time": np.floor(signals["time"] * 20) / 20})


def _interleaved(signals: Signals, csv: Callable[..., bytes]) -> bytes:
    lines = csv(signals, test="a").split(b"\n")
    return b"\n".join(
        line.replace(b"a,", b"b,", 1) if i % 2 and i > 1 else line for i, line in enumerate(lines)
    )


NAME = "dwell_1.00Hz.csv"
CASES: dict[str, tuple[str, Build, str]] = {
    "empty file": (NAME, lambda s, csv: b"", "is empty.*Remedy: record again"),
    "blank lines only": (NAME, lambda s, csv: b"\n\n \n", "is empty"),
    "header without data": (NAME, lambda s, csv: csv(s).split(b"\n")[0] + b"\n", "header but no data"),
    "a single line": (NAME, lambda s, csv: b"time [s],road_height [m]", "single line"),
    "no header": (NAME, lambda s, csv: csv(s).split(b"\n", 1)[1], "has no header line.*time \\[s\\]"),
    "no time column": (NAME, _without("time"), "channel 'time': no column is the time.*channels.toml"),
    "no road": (NAME, _without("road_height"), "channel 'road_height'.*missing.*channels.toml"),
    "no response": (NAME, _without("sprung_accel", "susp_deflection"), "neither sprung_accel nor susp_defl"),
    "no known column": (
        NAME,
        lambda s, csv: b"time [s],a,b\n0,1,2\n1,2,3\n",
        "no column is known: found.*'a'",
    ),
    "unknown unit": (NAME, _replaced(b"road_height [m]", b"road_height [zorch]"), "unknown unit 'zorch'"),
    "unit of something else": (NAME, _replaced(b"road_height [m]", b"road_height [s]"), "'s' is a time"),
    "unit of the time": (NAME, _replaced(b"time [s]", b"time [m]"), "channel 'time': unit 'm' is a length"),
    "mm called m": (NAME, _scaled("susp_deflection", 1e3), "channel 'susp_deflection'.*not possible.*mm"),
    "mm/s^2 called m/s^2, hardly beyond": (
        NAME,
        lambda s, csv: csv(s | {"sprung_accel": s["sprung_accel"] * 300.1 / np.abs(s["sprung_accel"]).max()}),
        "sprung_accel'.*1 of 1000 samples are not possible.*mm/s.2",
    ),
    "road in mm called m": (
        NAME,
        _scaled("road_height", 1e3),
        "channel 'road_height', at .* s: .*not possible",
    ),
    "deg called rad": (NAME, _scaled("link_angle", 180 / np.pi), "channel 'link_angle'.*deg"),
    "ms called s": (NAME, _scaled("time", 1e3), "samples are 10 s apart.*ms"),
    "us called s": (NAME, _scaled("time", 1e6), "samples are 1e\\+04 s apart"),
    "s called ms": (NAME, _replaced(b"time [s]", b"time [us]"), "samples are 1e-08 s apart"),
    "time backwards": (NAME, _backwards, "at 4.990 s: time runs backwards by 1.99 s.*split the file"),
    "time jumps far": (NAME, _gap, "at 4.990 s: time jumps by 4.01 s"),
    "time without digits": (NAME, _coarse_time, "repeat the time stamp.*more digits"),
    "time stamp missing": (NAME, _edit("time", 300, np.nan), "channel 'time'.*stamp of sample 301"),
    "long gap of values": (
        NAME,
        _edit("sprung_accel", slice(200, 400), np.nan),
        "channel 'sprung_accel', at 2.000 s: 200 of 1000 samples are missing, the longest gap is 2.01 s",
    ),
    "many small gaps": (
        NAME,
        lambda s, csv: csv(
            s | {"sprung_accel": np.where(np.arange(1000) % 7 < 2, np.nan, s["sprung_accel"])}
        ),
        "samples are missing",
    ),
    "infinite values": (
        NAME,
        _edit("sprung_accel", slice(123, 223), np.inf),
        "sprung_accel', at 1.230 s: 100 of 1000 values are inf",
    ),
    "impossible values": (
        NAME,
        _edit("sprung_accel", slice(123, 223), -1e9),
        "sprung_accel', at 1.230 s: 100 of 1000 samples are not possible \\(up to 1e\\+09 m/s.2\\), the data may",
    ),
    "stuck road": (NAME, _edit("road_height", slice(0, 1000), 0.005), "channel 'road_height'.*unusable"),
    "dwell too short": (NAME, _cut(2.5), "test 'dwell_1.00Hz': the dwell holds 2.5 periods in 2.49 s"),
    "row too long": (NAME, _line(41, lambda line: line + b",7"), "line 42 has 6 cells, the header has 5"),
    "row too short": (NAME, _line(41, lambda line: line.rpartition(b",")[0]), "line 42 has 4 cells"),
    "word for a number": (
        NAME,
        _line(41, lambda line: b"0.4,oops,0,0,0"),
        "channel 'road_height \\[m\\]': 'oops' in data row 41 is not a number",
    ),
    "unpaired quote": (NAME, _line(41, lambda line: b'0.4,"0,0,0,0'), "cannot be parsed.*quotation mark"),
    "short row in quotes": (NAME, _line(41, lambda line: b'"0.4","0",0'), "line 42 has 3 cells"),
    "decimal comma": (
        NAME,
        lambda s, csv: csv(s).replace(b"0.", b"0,"),
        "cells, the header has 5.*decimal comma",
    ),
    "duplicate column": (
        NAME,
        _replaced(b"link_angle [rad]", b"road_height [m]"),
        "'road_height \\[m\\]' is there",
    ),
    "two that look alike": (
        NAME,
        lambda s, csv: csv(
            {("az" if n == "sprung_accel" else n): v for n, v in s.items()} | {"acc_z": s["time"]}
        ),
        "'az' and 'acc_z' could both be it",
    ),
    "not text": (NAME, lambda s, csv: bytes(range(256)) * 8 + b"\n", "is not a text file"),
    "text after binary": (NAME, lambda s, csv: csv(s) + b"\x00" * 40 + b"\n", "is not a text file"),
    "endless line": (NAME, lambda s, csv: b"1" * 5_000_000, "longer than"),
    "gzip cut in the header": (
        NAME + ".gz",
        lambda s, csv: gzip.compress(csv(s))[:40],
        "nothing in it is whole",
    ),
    "gzip garbage": (NAME + ".gz", lambda s, csv: b"\x1f\x8b" + b"rubbish" * 9, "compressed data is damaged"),
    "unknown suffix": ("dwell.xlsx", lambda s, csv: csv(s), "suffix that no reader knows"),
    "gravity downwards": (
        NAME,
        lambda s, csv: csv(s | {"sprung_accel": -9.81 - s["sprung_accel"]}),
        "channel 'sprung_accel': its mean is -9.8.*sign = -1",
    ),
    "rows out of order": ("runs.csv", _interleaved, "test 'a': the rows of this test are in .* pieces"),
    "no row in a test": (
        "runs.csv",
        lambda s, csv: b"test,time [s],road [m]\n,0,1\n,1,2\n",
        "no row belongs",
    ),
}


@over("case", CASES)
def test_broken_table_is_refused_with_reason_place_and_remedy(
    case: str, tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    name, build, message = CASES[case]
    path = tmp_path / name
    path.write_bytes(build(signals(), csv_bytes))
    with pytest.raises(InputError, match=message) as caught:
        load_campaign(path)
    assert str(path) in str(caught.value)
    assert "Remedy: " in str(caught.value)
    check_refusal(path, caught.value)


def test_the_table_behind_the_broken_ones_is_good(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    path = tmp_path / NAME
    path.write_bytes(csv_bytes(signals()))
    campaign = load_campaign(path)
    assert campaign.warnings == ()
    assert campaign.recordings[0].frequency_hz == 1.0


def test_paths_that_are_no_campaign(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        load_campaign(tmp_path / "none.csv")
    with pytest.raises(InputError, match="the folder holds no campaign"):
        load_campaign(tmp_path)


def test_a_file_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / NAME
    path.write_text("time [s]\n")

    def refuse(*args: object, **kwargs: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(InputError, match=r"Permission denied.*permissions"):
        load_campaign(path)


def test_the_same_test_in_two_files(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_bytes(csv_bytes(signals(), test="dwell_1Hz"))
    with pytest.raises(InputError, match=r"test .dwell_1Hz.: the test is in a\.csv and in b\.csv"):
        load_campaign(tmp_path)


def test_two_files_may_each_have_a_standstill(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    for name, test in (("a.csv", "dwell_1Hz"), ("b.csv", "dwell_2Hz")):
        header, *rows = csv_bytes(signals(), test=test).splitlines(keepends=True)
        still = csv_bytes(signals(), test="standstill").splitlines(keepends=True)[1:]
        (tmp_path / name).write_bytes(b"".join([header, *rows, *still]))
    found = load_campaign(tmp_path)
    assert [each.name for each in found.of_kind("standstill")] == [
        "standstill of a.csv",
        "standstill of b.csv",
    ]


MAPS = {
    "not TOML": ("[channels", "is not TOML"),
    "unknown table": ("[chanels.road_height]\n", "unknown table 'chanels'"),
    "unknown channel": ('[channels.wheel]\ncolumn = "x"', "'wheel' is not a known channel"),
    "unknown key": ('[channels.road_height]\ncolumn = "x"\ngain = 2', "unknown key.*'gain'"),
    "nothing in it": ("[channels.road_height]\n", "says nothing"),
    "both column and topic": (
        '[channels.road_height]\ncolumn = "x"\ntopic = "y"',
        "a column and a topic",
    ),
    "sign of two": ('[channels.road_height]\ncolumn = "x"\nsign = 2', "neither 1 nor -1"),
    "scale in words": (
        '[channels.road_height]\ncolumn = "x"\nscale = "big"',
        "'scale' is not a finite number",
    ),
    "scale without end": (
        f'[channels.road_height]\ncolumn = "x"\nscale = {"9" * 400}',
        "'scale' is not a finite number",
    ),
    "column as number": ("[channels.road_height]\ncolumn = 3", "'column' is not a text"),
    "not a table": ("channels = 3", "'channels' is not a table"),
    "unknown clock": ('[time]\nclock = "sun"', "clock 'sun' is not known.*header, log, publish"),
    "absent column": ('[channels.road_height]\ncolumn = "cam"', "names column 'cam'.*the columns are time"),
    "absent time": ('[time]\ncolumn = "tick"', "names column 'tick'"),
    "unknown unit": (
        '[channels.road_height]\ncolumn = "road_height"\nunit = "zorch"',
        "channel 'road_height': unknown unit 'zorch'",
    ),
}


@over("case", MAPS)
def test_broken_channel_map(
    case: str, tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    text, message = MAPS[case]
    (tmp_path / "channels.toml").write_text(text)
    (tmp_path / NAME).write_bytes(csv_bytes(signals()))
    with pytest.raises(InputError, match=message) as caught:
        load_campaign(tmp_path / NAME)
    check_refusal(tmp_path / NAME, caught.value)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no list of open files")
def test_a_file_that_is_refused_half_way_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "words.csv"
    path.write_text("only words here\n" * 3)
    with pytest.raises(InputError) as refused:
        load_campaign(path)
    still_open = [each.readlink() for each in Path("/proc/self/fd").iterdir() if each.is_symlink()]
    assert path not in still_open
    assert refused.value.source
