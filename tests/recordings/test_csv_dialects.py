"""The ways laboratories write a table all give the same recording."""

import gzip
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.recordings.channels import ChannelMap, ChannelRule
from savgs_ident.recordings.recording import Campaign, Header, classify_test
from savgs_ident.recordings.units import UNITS, find_unit

from ..in_one_test import over

Signals = dict[str, NDArray[np.float64]]
Csv = Callable[..., bytes]

LAB = {
    "time": "Time (ms)",
    "road_height": "road_mm",
    "sprung_accel": "accel_z (g)",
    "susp_deflection": "Suspension Deflection [mm]",
    "link_angle": "link_angle [deg]",
}
LAB_SCALES = {
    "time": 1e3, "road_height": 1e3, "sprung_accel": 1 / 9.80665, "susp_deflection": 1e3,
    "link_angle": 180 / np.pi,
}  # fmt: skip


def _lab(signals: Signals) -> Signals:
    return {name: values * LAB_SCALES[name] for name, values in signals.items()}


def _comma(text: bytes) -> bytes:
    return text.replace(b".", b",")


def _with_unit_row(text: bytes) -> bytes:
    _, body = text.split(b"\n", 1)
    return b"time;road;acc_z;deflection;link_angle\ns;m;m/s\xc2\xb2;m;rad\n" + body


TITLE = b"Quarter-car rig 3\nOperator: A. B.\n\nRate 1000 Hz, filter off\n"
NAMED = b"time;road_height;sprung_accel;susp_deflection;link_angle\n"
WORDS = b"clock;plate;body;strut;crank\ns;m;m/s^2;m;rad\n"


def _dated(signals: Signals, csv: Csv, form: str) -> bytes:
    """With a clock that shows dates, to the microsecond."""
    head, *rows = csv(signals).splitlines()
    start = datetime(2026, 3, 1, 23, 59, 59, tzinfo=UTC)
    stamps = [start + timedelta(seconds=float(t)) for t in signals["time"]]
    later = [
        f"{stamp:{form}}".encode() + row[row.index(b",") :] for stamp, row in zip(stamps, rows, strict=True)
    ]
    return b"\n".join([b"time" + head[head.index(b",") :], *later]) + b"\n"


def _quoted_commas(text: bytes) -> bytes:
    head, *rows = text.splitlines()
    cells = [b",".join(b'"' + cell.replace(b".", b",") + b'"' for cell in row.split(b",")) for row in rows]
    return b"\n".join([head, *cells]) + b"\n"


PREAMBLE = b"""Date:;2020-07-08 21:11:37
Firmware:;0x0120;0x6150
Index:;0x30D3;0x30D2;0x0000
Max. samples:;500
Recorded samples:;500
Sampling period:;6.400
Scale:;0;True;2.000;-159.000;151.000;167.000
Trigger:;1;0.000000;"Channel 1";"Rising above value"
"""
"""As a drive's commissioning tool writes it: lines of words and numbers, of two cells and of more."""

DIALECTS: dict[str, Callable[[Signals, Csv], bytes]] = {
    "units of the laboratory": lambda s, csv: csv(_lab(s), headers=LAB),
    "semicolons": lambda s, csv: csv(s, separator=";"),
    "tabs": lambda s, csv: csv(s, separator="\t"),
    "decimal commas": lambda s, csv: csv(s, separator=";").replace(b".", b","),
    "row of units": lambda s, csv: _with_unit_row(csv(s, separator=";")),
    "byte order mark": lambda s, csv: b"\xef\xbb\xbf" + csv(s),
    "Windows line ends": lambda s, csv: csv(s).replace(b"\n", b"\r\n"),
    "comments and blank lines": lambda s, csv: b"# rig 3\n\n# monday\n" + csv(s).replace(b"\n", b"\n\n", 5),
    "quoted headers": lambda s, csv: csv(s, headers={n: f'"{n} [{u}]"' for n, u in _si().items()}),
    "Latin-1 degree sign": lambda s, csv: (
        csv(
            s | {"link_angle": s["link_angle"] * 180 / np.pi},
            headers=_si_headers() | {"link_angle": "link_angle [°]"},
        )
        .decode()
        .encode("latin-1")
    ),
    "spaces after commas": lambda s, csv: csv(s).replace(b",", b", "),
    "a column more": lambda s, csv: csv({"remark": np.zeros(1000)} | s),
    "later start of the clock": lambda s, csv: csv(s | {"time": s["time"] + 1234.5}),
    "several gzip members": lambda s, csv: _members(csv(s)),
    "UTF-16": lambda s, csv: csv(s).decode().encode("utf-16"),
    "UTF-16, the other way round": lambda s, csv: b"\xfe\xff" + csv(s).decode().encode("utf-16-be"),
    "pipes": lambda s, csv: csv(s, separator="|"),
    "white space": lambda s, csv: (
        b"  " + csv(s, headers=_underlined(), separator="  ").replace(b"\n", b"\n  ")
    ),
    "title lines": lambda s, csv: TITLE + csv(s),
    "title lines and a table of semicolons": lambda s, csv: TITLE + _comma(csv(s, separator=";")),
    "a row of words and a row of units": lambda s, csv: (
        TITLE + NAMED + WORDS + csv(s, separator=";").split(b"\n", 1)[1]
    ),
    "a preamble with numbers, and a time without a name": lambda s, csv: (
        PREAMBLE + _with_unit_row(csv(s, separator=";")).replace(b"time", b"", 1)
    ),
    "quoted decimal commas": lambda s, csv: _quoted_commas(csv(s)),
    "ISO dates": lambda s, csv: _dated(s, csv, "%Y-%m-%dT%H:%M:%S.%f"),
    "ISO dates with a zone": lambda s, csv: _dated(s, csv, "%Y-%m-%d %H:%M:%S.%f+00:00"),
    "dates that begin with the day": lambda s, csv: _dated(s, csv, "%d.%m.%Y %H:%M:%S.%f"),
}

TITLED = (
    "title lines",
    "title lines and a table of semicolons",
    "a row of words and a row of units",
    "a preamble with numbers, and a time without a name",
)
"""Dialects with lines above the names of the columns, which a warning tells of."""


def _underlined() -> dict[str, str]:
    return {name: f"{name}[{unit.replace(' ', '')}]" for name, unit in _si().items()}


def _si() -> dict[str, str]:
    return {name: RIG_LAYOUT.si_unit(name) for name in ("time", *RIG_LAYOUT.names)}


def _si_headers() -> dict[str, str]:
    return {name: f"{name} [{unit}]" for name, unit in _si().items()}


def _members(text: bytes) -> bytes:
    return gzip.compress(text[:5000]) + gzip.compress(text[5000:])


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_gives_the_same_recording(
    dialect: str, tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Csv
) -> None:
    path = tmp_path / "dwell_1.00Hz.csv"
    path.write_bytes(DIALECTS[dialect](signals(), csv_bytes))
    campaign = load_campaign(path)
    assert [each.code for each in campaign.warnings] == ["lines_skipped"] * (dialect in TITLED)
    # Seconds since 1970 have no finer steps.
    _same(campaign, signals(), 3e-7 if "dates" in dialect else 1e-9)


def _same(campaign: Campaign, signals: Signals, time_apart: float = 1e-9) -> None:
    (recording,) = campaign.recordings
    assert (recording.name, recording.kind, recording.frequency_hz) == ("dwell_1.00Hz", "dwell", 1.0)
    assert set(recording.channels) == set(signals) - {"time"}
    for name, channel in recording.channels.items():
        assert channel.unit == RIG_LAYOUT.si_unit(name)
        np.testing.assert_allclose(channel.values, signals[name], rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(channel.time, signals["time"], rtol=0, atol=time_apart)


def test_channels_are_read_only(tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Csv) -> None:
    path = tmp_path / "dwell_1.00Hz.csv"
    path.write_bytes(csv_bytes(signals()))
    channel = load_campaign(path).recordings[0].channels["road_height"]
    with pytest.raises(ValueError, match="read-only"):
        channel.values[0] = 1.0


def test_a_header_without_unit_is_taken_as_si_and_reported(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Csv
) -> None:
    path = tmp_path / "dwell_1.00Hz.csv"
    path.write_bytes(csv_bytes(signals(), headers={}))
    campaign = load_campaign(path)
    assert [w.code for w in campaign.warnings] == ["unit_assumed"] * 5
    assert "'road_height' has no unit, taken as m" in str(campaign.warnings[1])
    _same(campaign, signals())


def test_a_channel_map_gives_names_units_signs_and_offsets(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Csv
) -> None:
    raw = signals()
    raw["susp_deflection"] = (-1e3 * raw["susp_deflection"] + 12.5) / 2
    raw["sprung_accel"] = raw["sprung_accel"] / 9.80665
    headers = {name: f"AI{i}" for i, name in enumerate(raw)}
    (tmp_path / "dwell_1.00Hz.csv").write_bytes(csv_bytes(raw, headers=headers))
    (tmp_path / "channels.toml").write_text(
        '[time]\ncolumn = "AI0"\nunit = "s"\n'
        '[channels.road_height]\ncolumn = "AI1"\nunit = "m"\n'
        '[channels.sprung_accel]\ncolumn = "AI2"\nunit = "g"\n'
        '[channels.susp_deflection]\ncolumn = "AI3"\nunit = "mm"\nscale = 2\noffset = -12.5\nsign = -1\n'
        '[channels.link_angle]\ncolumn = "AI4"\nunit = "rad"\n'
    )
    for campaign in (load_campaign(tmp_path), load_campaign(tmp_path / "dwell_1.00Hz.csv")):
        assert campaign.warnings == ()
        _same(campaign, signals())


def test_a_map_wins_over_the_usual_name(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Csv
) -> None:
    path = tmp_path / "dwell_1.00Hz.csv"
    path.write_bytes(csv_bytes(signals() | {"road_2": 2 * signals()["road_height"]}))
    rule = ChannelRule("road_height", column="road_2", unit="m")
    road = load_campaign(path, ChannelMap(RIG_LAYOUT, (rule,))).recordings[0].channels["road_height"]
    np.testing.assert_allclose(road.values, 2 * signals()["road_height"])
    assert road.source == "road_2"


def test_a_folder_with_one_test_a_file(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Csv
) -> None:
    reported: list[float] = []
    for frequency in (1.0, 2.0, 3.0):
        (tmp_path / f"dwell_{frequency}Hz.csv").write_bytes(csv_bytes(signals(frequency)))
    (tmp_path / "notes.md").write_text("not a recording")
    campaign = load_campaign(tmp_path, progress=reported.append)
    assert [r.frequency_hz for r in campaign.recordings] == [1.0, 2.0, 3.0]
    assert reported == sorted(reported)
    assert reported[-1] == 1.0
    (tmp_path / "dwell_3.0Hz.csv").write_bytes(csv_bytes(signals(3.0, 12.0)))
    assert load_campaign(tmp_path).sha256 != campaign.sha256


def test_a_file_much_larger_than_a_block(
    tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Csv
) -> None:
    long = signals(1.0, 1600.0)
    (tmp_path / "dwell_1.00Hz.csv").write_bytes(csv_bytes(long, test="dwell_1.00Hz"))
    assert (tmp_path / "dwell_1.00Hz.csv").stat().st_size > 2 * (1 << 22)
    _same(load_campaign(tmp_path), long)


@over(
    ("name", "kind", "frequency"),
    [
        ("dwell_2.35Hz", "dwell", 2.35), ("dwell 0.5 Hz run 2", "dwell", 0.5), ("2p75hz", "dwell", 2.75),
        ("harmonic", "dwell", None), ("sweep_0_3Hz_60s", "sweep", None), ("Chirp 3 Hz", "sweep", None),
        ("standstill", "standstill", None), ("at_rest", "standstill", None), ("monday", "other", None),
        ("step_up", "step", None), ("square_0.5Hz", "step", None), ("speed bump", "step", None),
        ("multisine", "road", None), ("multi-sine run 3", "road", None), ("Multi_Sinus", "road", None),
        ("step_03_1.2Hz", "dwell", 1.2), ("stepped_sine", "dwell", None),
        ("dwell_0Hz", "dwell", None), ("dwell_" + 400 * "9" + "Hz", "dwell", None),
    ],
)  # fmt: skip
def test_names_say_kind_and_frequency(name: str, kind: str, frequency: float | None) -> None:
    assert classify_test(name) == (kind, frequency)


@over(
    ("text", "header"),
    [
        ("a [m/s^2]", Header("a", "m/s^2")), ("accel_z (g)", Header("accel_z", "g")),
        ("deflection_mm", Header("deflection", "mm")), ("z_r", Header("z_r", None)),
        ("time_ms", Header("time", "ms")), ("link_angle_deg", Header("link_angle", "deg")),
        ("link_angle", Header("link_angle", None)), ("[m]", Header("[m]", None)),
    ],
)  # fmt: skip
def test_headers_split_into_label_and_unit(text: str, header: Header) -> None:
    assert RIG_LAYOUT.split_header(text) == header


@over(
    ("text", "channel", "factor"),
    [
        ("m/s²", "sprung_accel", 1.0), ("m/s**2", "sprung_accel", 1.0), ("m s^-2", "sprung_accel", 1.0),
        ("g", "sprung_accel", 9.80665), ("mg", "sprung_accel", 9.80665e-3), ("MM", "susp_deflection", 1e-3),
        ("µm", "susp_deflection", 1e-6), ("°", "link_angle", np.pi / 180),
        ("°/s", "link_velocity", np.pi / 180),
        ("rpm", "link_velocity", 2 * np.pi / 60), ("mA", "motor_current", 1e-3), ("us", "time", 1e-6),
    ],
)  # fmt: skip
def test_units(text: str, channel: str, factor: float) -> None:
    assert RIG_LAYOUT.unit_factor(text, channel) == pytest.approx(factor, rel=1e-15)


def test_tables_are_consistent() -> None:
    dimensions = {UNITS[RIG_LAYOUT.si_unit(name)].dimension for name in ("time", *RIG_LAYOUT.names)}
    known = [unit.dimension for unit in UNITS.values() if unit.factor == 1.0]
    assert dimensions <= {unit.dimension for unit in UNITS.values()} == set(known)
    for channel in RIG_LAYOUT.channels:
        assert RIG_LAYOUT.unit_factor(channel.unit, channel.name) == 1.0
        assert RIG_LAYOUT.is_exact(channel.name)
        assert all(RIG_LAYOUT.canonical_name(alias) == channel.name for alias in channel.aliases)
    aliases = [alias for channel in RIG_LAYOUT.channels for alias in (channel.name, *channel.aliases)]
    assert len(set(aliases)) == len(aliases)
    assert find_unit("furlong") is None
