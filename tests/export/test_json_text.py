"""JSON for people: one line a list of plain values, and the very same values when read back."""

import json
import math
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.export.json_text import as_plain, json_text, write_json_text

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=4),
    max_leaves=20,
)


@given(values)
def test_what_is_written_is_read_back(value: object) -> None:
    assert json.loads(json_text(as_plain(value, "x"))) == value


def test_a_half_of_a_surrogate_pair_survives(tmp_path: Path) -> None:
    path = write_json_text(tmp_path / "x.json", {"a": "\ud800é"})
    assert json.loads(path.read_bytes().decode("utf-8")) == {"a": "\ud800é"}


def test_a_vector_takes_one_line() -> None:
    assert json_text({"a": list(range(1000))}).count("\n") == 3


@pytest.mark.parametrize("value", [math.nan, math.inf, date(2020, 1, 1), b"x", {1, 2}])
def test_what_json_cannot_say_is_named_by_its_place(value: object) -> None:
    with pytest.raises(InputError, match=r"x\.a\[1\] is .*, which JSON cannot say"):
        as_plain({"a": [0, value]}, "x")


def test_arrays_and_tuples_become_lists() -> None:
    assert as_plain({"a": np.eye(2), "b": (np.float64(0.1), 2)}, "x") == {
        "a": [[1.0, 0.0], [0.0, 1.0]],
        "b": [0.1, 2],
    }
