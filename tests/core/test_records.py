"""Records come back from JSON as they went, and what is no such record is refused with its place."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import pytest

from savgs_ident.core.files import record_of

from ..in_one_test import over


@dataclass(frozen=True)
class Inner:
    low: float
    high: float


@dataclass(frozen=True)
class Outer:
    number: int
    kind: Literal["a", "b"]
    names: tuple[str, ...]
    more: Sequence[float]
    sure: bool | None
    inner: Mapping[str, Inner]
    share: float | None = None
    counts: dict[str, int] = field(default_factory=dict)


RECORD = Outer(3, "a", ("x", "y"), (1.0, 2), True, {"p": Inner(0.5, 1)}, None, {"n": 2})
FIELDS: dict[str, Any] = json.loads(json.dumps(asdict(RECORD)))


def test_a_record_comes_back() -> None:
    found = record_of(Outer, FIELDS)
    assert found == RECORD
    assert json.dumps(asdict(found)) == json.dumps(asdict(RECORD))


def test_what_has_a_default_may_be_missing() -> None:
    assert record_of(Outer, {name: FIELDS[name] for name in list(FIELDS)[:6]}).counts == {}


@over(
    ("change", "said"),
    [
        ({"number": 1.5}, "number is 1.5, not a whole number"),
        ({"number": True}, "number is True, not a whole number"),
        ({"kind": "c"}, "kind is 'c', not one of: a, b"),
        ({"kind": ["a"]}, "kind is a list, not one of"),
        ({"names": "xy"}, "names is 'xy', not a list"),
        ({"names": ["x", 3]}, r"names\[1\] is a whole number, not a text"),
        ({"more": [float("nan")]}, r"more\[0\] is nan, not a finite number"),
        ({"more": [10**400]}, r"more\[0\] is a whole number, not a finite number"),
        ({"more": [False]}, "not a number"),
        ({"sure": 1}, "sure is a whole number, not true or false"),
        ({"inner": []}, "inner is a list, not a table"),
        ({"inner": {"p": {"low": 0.5}}}, r"inner\.p\.high is missing"),
        ({"inner": {"p": {"low": 0.5, "high": 1.0, "mid": 0.7}}}, r"inner\.p\.'mid' is not known"),
        ({"counts": {"n": None}}, r"counts\.n is None"),
        ({"x": 1}, "'x' is not known"),
    ],
)
def test_what_is_no_such_record_is_refused(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        record_of(Outer, FIELDS | change)


@over("found", [None, [], 3, "text", [FIELDS]])
def test_what_is_no_table_is_refused(found: object) -> None:
    with pytest.raises(ValueError, match="not a table"):
        record_of(Outer, found)
