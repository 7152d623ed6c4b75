"""Nobody changes a sealed answer, or the recordings that it belongs to, and goes unnoticed."""

import json
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from typing import Any

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.validation.blind_answer import (
    Answer,
    Envelope,
    Seal,
    SmallErrors,
    envelope_of,
    opened,
    sealed,
)

from ..in_one_test import over
from .blind_answers import answer

TRUTH = answer("effect", "accel_lag", number=7, accel_lag_time=0.01)
ENVELOPE = Envelope(TRUTH, "00ff")
DATA = "a" * 64
SEAL = sealed(ENVELOPE, DATA)


def _other(value: Any) -> Any:
    """Something that differs from a field's value as little as may be."""
    if isinstance(value, int):
        return value + 1
    if isinstance(value, str):
        return "two"
    if value is None:
        return SmallErrors((), 0.0, 0.0, 0.0)
    if isinstance(value, dict):
        return {name: each * (1.0 + 1e-15) for name, each in value.items()} | {"more": 1.0}
    return (*value, "cam_scale")


def test_a_seal_that_nobody_touched_opens_after_writing() -> None:
    written = json.loads(json.dumps({"seal": asdict(SEAL), "envelope": asdict(ENVELOPE)}))
    assert opened(Seal(**written["seal"]), envelope_of(written["envelope"]), DATA) == TRUTH


@over("field", [each.name for each in fields(Answer)])
def test_every_part_of_the_answer_is_sealed(field: str) -> None:
    changed = replace(TRUTH, **{field: _other(getattr(TRUTH, field))})
    with pytest.raises(InputError, match="not the one that was sealed"):
        opened(SEAL, replace(ENVELOPE, answer=changed), DATA)


@over(
    ("open_it", "said"),
    [
        (lambda: opened(SEAL, replace(ENVELOPE, salt="00fe"), DATA), "answer is not the one"),
        (lambda: opened(SEAL, replace(ENVELOPE, salt="\ud800"), DATA), "answer is not the one"),
        (lambda: opened(SEAL, ENVELOPE, "b" * 64), "recordings are not those"),
        (lambda: opened(replace(SEAL, answer="c" * 64), ENVELOPE, DATA), "answer is not the one"),
        (lambda: opened(replace(SEAL, recordings="c" * 64), ENVELOPE, DATA), "recordings are not those"),
    ],
)
def test_salt_recordings_and_seal_itself(open_it: Callable[[], Answer], said: str) -> None:
    with pytest.raises(InputError, match=said):
        open_it()


def test_the_same_answer_has_another_seal_with_another_salt() -> None:
    assert sealed(replace(ENVELOPE, salt="00fe"), DATA).answer != SEAL.answer
