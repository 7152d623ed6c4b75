"""The same tests in every format that test labs have: the same channels, to the last bit."""

import sys
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.read import READERS, read_campaign
from savgs_ident.recordings.recording import Campaign, ChannelSpec, RecordingLayout

LAYOUT = RecordingLayout(
    (ChannelSpec("voltage", "V", "voltage"), ChannelSpec("angle", "rad", "angle")), "voltage", ("angle",)
)
HERTZ, RATE = 2.0, 200.0
TIME = np.arange(1600) / RATE
VOLTS = 4.0 * np.sin(2.0 * np.pi * HERTZ * TIME)
DEGREES = 20.0 * np.sin(2.0 * np.pi * HERTZ * TIME - 0.5) + 1.0
Columns = Mapping[str, NDArray[np.float64]]


def _checked(campaign: Campaign, name: str = "dwell_2Hz", exact: bool = True) -> None:
    (recording,) = campaign.recordings
    assert (recording.name, recording.kind, recording.frequency_hz) == (name, "dwell", HERTZ)
    assert set(recording.channels) == {"voltage", "angle"}
    volts, angle = recording.channels["voltage"], recording.channels["angle"]
    np.testing.assert_allclose(volts.time, TIME, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(volts.values, VOLTS, rtol=0.0, atol=0.0 if exact else 1e-6)
    np.testing.assert_allclose(angle.values, np.deg2rad(DEGREES), rtol=1e-15 if exact else 1e-6)
    assert (volts.unit, angle.unit) == ("V", "rad")


def _parquet(path: Path, columns: Mapping[str, object], units: Mapping[str, str]) -> None:
    table = pa.table(dict(columns))
    fields = [
        field.with_metadata({"unit": units[field.name]}) if field.name in units else field
        for field in table.schema
    ]
    pq.write_table(table.cast(pa.schema(fields)), path)


def test_parquet_with_units_in_names_and_in_fields(tmp_path: Path) -> None:
    path = tmp_path / "dwell_2Hz.parquet"
    _parquet(path, {"time [s]": TIME, "voltage": VOLTS, "angle": DEGREES}, {"voltage": "V", "angle": "deg"})
    _checked(read_campaign(path, LAYOUT))


def test_parquet_with_tests_and_with_dates(tmp_path: Path) -> None:
    start = np.datetime64("2026-03-01T10:00:00", "us")
    stamps = start + np.round(TIME * 1e6).astype("timedelta64[us]")
    columns = {
        "run": ["dwell_2Hz"] * 1600 + ["standstill"] * 400,
        "time": np.concatenate([stamps, stamps[:400] + np.timedelta64(60, "s")]),
        "voltage [V]": np.concatenate([VOLTS, np.zeros(400)]),
        "angle [deg]": np.concatenate([DEGREES, np.full(400, 0.5)]),
        "operator": ["A"] * 2000,
    }
    path = tmp_path / "campaign.parquet"
    _parquet(path, columns, {})
    campaign = read_campaign(path, LAYOUT)
    assert [each.name for each in campaign.recordings] == ["dwell_2Hz", "standstill"]
    dwell = campaign.recordings[0]
    np.testing.assert_allclose(dwell.channels["voltage"].time, TIME, atol=1e-6)
    assert dwell.start == pytest.approx(1772359200.0)
    np.testing.assert_array_equal(dwell.channels["voltage"].values, VOLTS)


@pytest.mark.parametrize("suffix", [".mat", ".parquet", ".csv"])
def test_a_test_is_named_after_its_file_decimals_and_all(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"dwell_1.7Hz{suffix}"
    columns = {"t [s]": TIME, "voltage [V]": VOLTS, "angle [deg]": DEGREES}
    match suffix:
        case ".mat":
            savemat(path, {"t": TIME, "voltage": VOLTS, "angle": np.deg2rad(DEGREES)})
        case ".parquet":
            _parquet(path, columns, {})
        case _:
            np.savetxt(
                path,
                np.stack(list(columns.values()), 1),
                delimiter=",",
                header=",".join(columns),
                comments="",
            )
    (recording,) = read_campaign(path, LAYOUT).recordings
    assert recording.name == "dwell_1.7Hz"


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_matlab_vectors_and_matrices(tmp_path: Path, version: str) -> None:
    path = tmp_path / "dwell_2Hz.mat"
    arrays = {
        "t": TIME[:, None],
        "U": VOLTS[:, None],
        "y": np.stack([DEGREES, 0.0 * TIME], axis=1),
        "note": 3.0,
    }
    if version == "5":
        savemat(path, arrays)
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, array in arrays.items():
                file[name] = np.asarray(array).T
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116))
    (tmp_path / "channels.toml").write_text(
        '[channels.voltage]\ncolumn = "U"\nunit = "V"\n[channels.angle]\ncolumn = "y_1"\nunit = "deg"\n'
        '[time]\ncolumn = "t"\nunit = "s"\n'
    )
    _checked(read_campaign(path, LAYOUT))


def test_tdms_with_a_clock_of_its_own_and_with_a_time_channel(tmp_path: Path) -> None:
    tdms = pytest.importorskip("nptdms", reason="the extra formats is not installed")
    for timed in (True, False):
        path = tmp_path / f"dwell_2Hz{'' if timed else '_'}.tdms"
        clock = {"wf_increment": 1.0 / RATE, "wf_start_offset": 0.0} if timed else {}
        channels = [
            tdms.ChannelObject("run", "voltage", VOLTS, {"unit_string": "V", **clock}),
            tdms.ChannelObject("run", "angle", DEGREES, {"unit_string": "deg", **clock}),
        ]
        if not timed:
            channels.append(tdms.ChannelObject("run", "time", TIME, {"unit_string": "s"}))
        with tdms.TdmsWriter(path) as writer:
            writer.write_segment(channels)
        _checked(read_campaign(path, LAYOUT), path.stem)


def test_mdf_with_a_clock_for_each_channel(tmp_path: Path) -> None:
    mdf = pytest.importorskip("asammdf", reason="the extra formats is not installed")
    path = tmp_path / "dwell_2Hz.mf4"
    signals = [
        mdf.Signal(VOLTS, TIME, unit="V", name="voltage"),
        mdf.Signal(DEGREES, TIME, unit="deg", name="angle"),
        mdf.Signal(np.arange(8.0), np.arange(8.0), unit="degC", name="oil"),
    ]
    with mdf.MDF() as file:
        file.append(signals[:2])
        file.append(signals[2:])
        file.save(path)
    _checked(read_campaign(path, LAYOUT))


@pytest.mark.parametrize(
    "reader", [each for each in READERS if not each.plain_text], ids=lambda each: each.name
)
def test_a_file_that_is_cut_or_of_another_kind_is_refused_in_words(reader: object, tmp_path: Path) -> None:
    suffix, magic = reader.suffixes[0], reader.magic[0]  # type: ignore[attr-defined]
    cut = tmp_path / f"cut{suffix}"
    cut.write_bytes(magic + bytes(range(256)) * 4)
    other = tmp_path / f"other{suffix}"
    other.write_bytes(b"time,voltage\n0,1\n")
    for path in (cut, other):
        with pytest.raises(InputError) as found:
            read_campaign(path, LAYOUT)
        assert str(path) in str(found.value)
        assert found.value.remedy


@pytest.mark.parametrize(
    ("package", "suffix", "magic"), [("nptdms", ".tdms", b"TDSm"), ("asammdf", ".mf4", b"MDF     ")]
)
def test_a_package_that_is_not_installed_is_named_with_the_command(
    package: str, suffix: str, magic: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    path = tmp_path / f"run{suffix}"
    path.write_bytes(magic + bytes(200))
    with pytest.raises(InputError, match=r"pip install 'savgs-ident\[formats\]'"):
        read_campaign(path, LAYOUT)


def test_signals_without_a_time_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    savemat(path, {"voltage": VOLTS, "angle": DEGREES})
    with pytest.raises(InputError, match=r"'voltage' has no time.*call a signal 'time'"):
        read_campaign(path, LAYOUT)
    savemat(path, {"t": TIME, "pressure": VOLTS})
    with pytest.raises(InputError, match="no signal is known: found 't', 'pressure'"):
        read_campaign(path, LAYOUT)


@pytest.mark.parametrize("title", ["", "Messung 3; 12.11.2026\n"])
def test_a_row_of_units_below_names_that_only_the_map_knows_is_read(tmp_path: Path, title: str) -> None:
    path, channels = tmp_path / "dwell_2Hz.csv", tmp_path / "channels.toml"
    rows = zip(TIME, VOLTS, DEGREES, strict=True)
    text = "".join(";".join(f"{value:.12g}".replace(".", ",") for value in row) + "\n" for row in rows)
    path.write_text(f"{title}Zeit;Spannung;Winkel\ns;V;deg\n{text}")
    channels.write_text(
        '[channels.voltage]\ncolumn = "Spannung"\n[channels.angle]\ncolumn = "Winkel"\n[time]\ncolumn = "Zeit"\n'
    )
    campaign = read_campaign(path, LAYOUT, channels)
    _checked(campaign, exact=False)
    assert not [each for each in campaign.warnings if each.code == "unit_assumed"]


def test_a_map_may_say_the_unit_of_what_has_its_usual_name(tmp_path: Path) -> None:
    """Of a MATLAB file, which has no units; a sign and a gain go along."""
    savemat(
        tmp_path / "dwell_2Hz.mat",
        {"t": 1e3 * TIME, "voltage": VOLTS, "angle": -0.5 * DEGREES - 1.0},
    )
    (tmp_path / "channels.toml").write_text(
        '[channels.voltage]\nunit = "V"\n[channels.angle]\nunit = "deg"\nscale = 2.0\noffset = 2.0\nsign = -1\n'
        '[time]\nunit = "ms"\n'
    )
    campaign = read_campaign(tmp_path, LAYOUT)
    _checked(campaign, exact=False)
    assert campaign.warnings == ()


def test_a_map_of_a_folder_may_name_the_time_of_files_that_need_it(tmp_path: Path) -> None:
    """Beside one of a format that has a clock for each channel."""
    nptdms = pytest.importorskip("nptdms")
    savemat(tmp_path / "dwell_2Hz.mat", {"clock": TIME, "voltage": VOLTS, "angle": np.deg2rad(DEGREES)})
    stamps = {"wf_increment": 1.0 / RATE, "wf_start_offset": 0.0}
    channels = [
        nptdms.ChannelObject("g", name, values, {**stamps, "unit_string": unit})
        for name, values, unit in (("voltage", VOLTS, "V"), ("angle", DEGREES, "deg"))
    ]
    with nptdms.TdmsWriter(tmp_path / "standstill.tdms") as writer:
        writer.write_segment(channels)
    (tmp_path / "channels.toml").write_text('[time]\ncolumn = "clock"\nunit = "s"\n')
    campaign = read_campaign(tmp_path, LAYOUT)
    assert sorted(each.name for each in campaign.recordings) == ["dwell_2Hz", "standstill"]
