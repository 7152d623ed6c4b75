"""Files are whole or absent, JSON is pure, folders are tried before the work."""

import csv
import errno
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import prepare_folder, to_json, write_bytes, write_json, write_table


def test_a_file_where_the_folder_should_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InputError, match="cannot be written"):
        prepare_folder(tmp_path / "out" / "fit")
    assert (tmp_path / "out").read_text() == "mine"


def test_a_full_disk_leaves_the_old_file_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "fit.json"
    target.write_text("old")

    def full(self: Path, other: Path) -> Path:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match="No space left on device"):
        write_bytes(target, b"new")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_stopping_in_the_middle_leaves_no_litter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(self: Path, other: Path) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", stopped)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "fit.json", b"new")
    assert list(tmp_path.iterdir()) == []


def test_json_holds_numpy_and_knows_no_nan(tmp_path: Path) -> None:
    record = {
        "a": np.float64(0.1),
        "b": np.array([1, 2]),
        "c": [np.inf, np.nan],
        "d": np.bool_(True),
        5: ("x",),
    }
    path = write_json(tmp_path / "r.json", record)
    assert json.loads(path.read_text()) == {"a": 0.1, "b": [1, 2], "c": [None, None], "d": True, "5": ["x"]}
    assert path.read_text() == to_json(record)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_json_keeps_every_digit(value: float) -> None:
    assert json.loads(to_json([value])) == [value]


def test_a_table_is_read_back(tmp_path: Path) -> None:
    path = write_table(tmp_path / "t.csv", {"f [Hz]": [1.0, 2.0], 'odd, "name"': ["a,b", 'c"d']})
    with path.open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows == [["f [Hz]", 'odd, "name"'], ["1.0", "a,b"], ["2.0", 'c"d']]
