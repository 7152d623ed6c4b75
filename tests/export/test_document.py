"""JSON documents: writing and reading them back, and every fault named by its place."""

import json
import math
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.export.document import JsonValue, as_plain, json_text, read_document, write_json_text

from ..in_one_test import over

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


@over("value", [math.nan, math.inf, date(2020, 1, 1), b"x", {1, 2}])
def test_what_json_cannot_say_is_named_by_its_place(value: object) -> None:
    with pytest.raises(InputError, match=r"x\.a\[1\] is .*, which JSON cannot say"):
        as_plain({"a": [0, value]}, "x")


def test_arrays_and_tuples_become_lists() -> None:
    assert as_plain({"a": np.eye(2), "b": (np.float64(0.1), 2)}, "x") == {
        "a": [[1.0, 0.0], [0.0, 1.0]],
        "b": [0.1, 2],
    }


FAULTS: dict[str, tuple[object, Callable[[JsonValue], object], str]] = {
    "no table": ([], lambda p: p.entries(), "at is [], not a table"),
    "lacking": ({}, lambda p: p.table(("a",)), "at.a is missing"),
    "too much": ({"a": 1, "b": 2}, lambda p: p.table(("a",)), "at.b is not known"),
    "no list": ({}, lambda p: p.items(), "at is {}, not a list"),
    "no text": (1, lambda p: p.text(), "at is 1, not a text"),
    "another text": ("x", lambda p: p.text(("y", "z")), "at is 'x', not one of: y, z"),
    "a name twice": (["x", "x"], lambda p: p.names(), "not a list of different names"),
    "a truth": (True, lambda p: p.number(), "at is True, not a finite number"),
    "infinite": (math.inf, lambda p: p.number(), "not a finite number"),
    "too large": (10**400, lambda p: p.number(), "not a finite number"),
    "text in a vector": ([1.0, "2"], lambda p: p.vector(), "at[1] is '2', not a finite number"),
    "ragged": ([[1.0], [1.0, 2.0]], lambda p: p.matrix(2, 1), "not a matrix of 2 rows and 1 columns"),
}


@over("fault", FAULTS)
def test_a_fault_is_named_by_its_place(fault: str) -> None:
    value, read, said = FAULTS[fault]
    with pytest.raises(InputError) as caught:
        read(JsonValue(value, "at"))
    assert said in caught.value.what


def test_places_are_written_as_one_would_look_for_them() -> None:
    document = JsonValue({"a": [{"b": 1}]})
    (first,) = document.table(("a",))["a"].items()
    assert first.table(("b",))["b"].where == "a[0].b"


def test_long_values_are_shown_by_their_beginning() -> None:
    assert len(JsonValue("x" * 5000, "at").wrong("a number").what) < 120


def test_matrices_come_back_in_their_shape() -> None:
    assert np.array_equal(
        JsonValue([[1, 2.5, 3], [4, 5, 6]]).matrix(2, 3), [[1.0, 2.5, 3.0], [4.0, 5.0, 6.0]]
    )
    assert JsonValue([]).matrix(0, 0).shape == (0, 0)
    assert JsonValue([[], []]).matrix(2, 0).shape == (2, 0)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b'{"a": 1, "a": 2}', "'a' is given twice"),
        (b'{"a": NaN}', "NaN is no finite number"),
        (b'{"a": -Infinity}', "-Infinity is no finite number"),
        (b'{"a": 1e999}', "1e999 is no finite number"),
        (b'{"a": "\xff"}', "is not such JSON"),
        (b"", "is not such JSON"),
        (b"[" * 100_000, "is not such JSON"),
    ],
)
def test_what_is_no_strict_json_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_document(path, "do this", lambda place: place.value)
    assert said in caught.value.what
    assert (caught.value.source, caught.value.remedy) == (str(path), "do this")
