"""The reader of recordings of an axis takes files from strangers: it reads what is right and refuses the rest."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from savgs_ident.core.errors import InputError
from savgs_ident.recordings import axis_recording as mat_file
from savgs_ident.recordings.axis_recording import read_axis

from ..in_one_test import over

COUNT = 400


def _contents() -> dict[str, Any]:
    t = 1e-3 * np.arange(COUNT)[:, None]
    return {"t": t, "qm": 0.1 * np.sin(t), "qg": 0.1 * np.sin(t) + 1e-5, "vir": np.cos(t), "gtau": 35.0}


def _written(folder: Path, packed: bool = True, **changes: Any) -> Path:
    path = folder / "run.mat"
    contents = {name: each for name, each in (_contents() | changes).items() if each is not None}
    savemat(path, contents, do_compression=packed)
    return path


def test_a_recording_comes_back_with_its_force_in_newtons(tmp_path: Path) -> None:
    recording = read_axis(_written(tmp_path))
    contents = _contents()
    np.testing.assert_array_equal(recording.position, contents["qm"].ravel())
    np.testing.assert_array_equal(recording.reference, contents["qg"].ravel())
    np.testing.assert_allclose(recording.force, 35.0 * contents["vir"].ravel(), rtol=1e-15)
    assert recording.step == pytest.approx(1e-3, rel=1e-12)


def test_rows_serve_as_well_as_columns(tmp_path: Path) -> None:
    turned = {name: each.T for name, each in _contents().items() if name != "gtau"}
    assert read_axis(_written(tmp_path, **turned)).time.shape == (COUNT,)


@pytest.mark.parametrize("name", ["t", "qm", "qg", "vir", "gtau"])
def test_what_is_missing_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=f"channel '{name}': is missing"):
        read_axis(_written(tmp_path, **{name: None}))


def _with(value: float, place: int = 250) -> np.ndarray:
    signal = np.array(_contents()["qm"])
    signal[place] = value
    return signal


@over(
    ("changes", "says"),
    [
        ({"qm": _with(np.nan)}, r"'qm', at 0.250 s: has a sample that is not a number"),
        ({"vir": _with(np.inf)}, r"'vir', at 0.250 s: has a sample that is not a number"),
        ({"qm": _with(1e300)}, "'qm': exceeds 100"),
        ({"t": np.full((COUNT, 1), np.nan)}, "'t': has a sample that is not a number"),
        ({"t": np.zeros((COUNT, 1))}, "not even and rising"),
        ({"t": 1e-3 * np.arange(COUNT)[::-1, None]}, "not even and rising"),
        ({"t": 1e-3 * np.arange(COUNT)[:, None] + 1e-3 * (np.arange(COUNT)[:, None] > 9)}, "not even"),
        ({"qm": np.zeros((COUNT - 1, 1))}, "has 399 samples, but t has 400"),
        ({"qg": np.zeros((20, 20))}, "has the shape"),
        ({"qg": np.zeros((0, 0))}, "has the shape"),
        ({"vir": np.zeros((COUNT, 1, 1, 2))}, "has the shape"),
        ({"qm": "a text"}, "is of class char"),
        ({"qm": {"field": 1.0}}, "is of class struct"),
        ({"qm": np.array([[1.0], ["x"]], dtype=object)}, "is of class cell"),
        ({"qm": _contents()["qm"] * 1j}, "is not real"),
        ({"gtau": np.nan}, "must be one positive number"),
        ({"gtau": -35.0}, "must be one positive number"),
        ({"gtau": np.array([1.0, 2.0])}, "must be one positive number"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_axis(_written(tmp_path, **changes))


def test_what_is_no_file_of_matlab_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    for raw in (
        b"",
        b"PK\x03\x04" + bytes(400),
        b"\x89HDF\r\n\x1a\n" + b"x" * 600,
        b"\x80\x04cposix\nsystem\n." * 20,
    ):
        path.write_bytes(raw)
        with pytest.raises(InputError, match="not a MATLAB file of version 5 to 7"):
            read_axis(path)
    for place in (tmp_path, tmp_path / "absent.mat", Path("/dev/zero")):
        with pytest.raises(InputError, match="is no file"):
            read_axis(place)


def test_a_file_cut_short_is_refused_wherever_it_is_cut(tmp_path: Path) -> None:
    path = _written(tmp_path)
    raw = path.read_bytes()
    for end in range(len(raw) - 9, 128, -len(raw) // 40):
        path.write_bytes(raw[:end])
        with pytest.raises(InputError):
            read_axis(path)


def test_what_unpacks_without_end_is_refused_before_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mat_file, "LARGEST", 2**22)
    path = _written(tmp_path)
    bomb = zlib.compress(bytes(2**24))
    assert len(bomb) < 2**15
    path.write_bytes(path.read_bytes() + struct.pack("<II", 15, len(bomb)) + bomb)
    with pytest.raises(InputError, match="unpacks to more than"):
        read_axis(path)


def test_a_signal_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    path = _written(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    path.write_bytes(path.read_bytes() + _written(other).read_bytes()[128:])
    with pytest.raises(InputError, match="is there more than once"):
        read_axis(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    changes=st.lists(st.tuples(st.integers(124, 1200), st.integers(0, 255)), min_size=1, max_size=6),
    packed=st.booleans(),
)
def test_whatever_is_changed_in_a_file_it_is_read_or_refused(
    tmp_path: Path, changes: list[tuple[int, int]], packed: bool
) -> None:
    raw = bytearray(_written(tmp_path, packed).read_bytes())
    for place, value in changes:
        raw[place % len(raw)] = value
    path = tmp_path / "changed.mat"
    path.write_bytes(raw)
    try:
        recording = read_axis(path)
    except InputError:
        return
    assert np.isfinite(recording.force).all()
    assert np.isfinite(recording.position).all()


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.sampled_from(["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"]),
    shape=st.lists(st.integers(1, 5), min_size=2, max_size=3),
    name=st.sampled_from(["x", "gtau", "a_rather_long_name"]),
    packed=st.booleans(),
)
def test_arrays_come_back_as_they_were_saved(
    tmp_path: Path, kind: str, shape: list[int], name: str, packed: bool
) -> None:
    """As SciPy writes them: column by column, small ones in one word."""
    array = np.random.default_rng(1).integers(0, 100, shape).astype(kind)
    path = tmp_path / "any.mat"
    savemat(path, {"other": {"a": 1.0}, "text": "none", name: array}, do_compression=packed)
    np.testing.assert_array_equal(mat_file.read_arrays(path, [name])[name], array)
