"""What commands leave behind to go on from is read strictly: what is not as it was written is not gone on from."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fuzz.kept import (
    MARKS,
    blind_seal,
    kept_blind,
    kept_draws,
    kept_seal,
    kept_trials,
    read_blind,
    read_blind_seal,
)
from fuzz.loader import Original
from fuzz.registry import LOADERS
from fuzz.trial import place
from savgs_ident.core.errors import InputError
from savgs_ident.validation.calibration import trial_reader
from savgs_ident.validation.false_alarms import read_draw
from savgs_ident.validation.trials import known_trials

NESTED = "[" * 100_000 + "]" * 100_000


@pytest.mark.parametrize(
    "start", ["1e308", "-1", "NaN", "1e999", "9" * 400, "[1.7e9]", '"x"', "true", NESTED]
)
def test_a_result_that_began_at_no_time_of_this_century_is_none_or_has_no_time(
    start: str, tmp_path: Path
) -> None:
    (content,) = kept_seal().contents
    seal = json.loads(content)
    changed = json.dumps(seal | {"start": "HERE"}).replace('"HERE"', start)
    path = place(LOADERS["kept-seal"], changed.encode(), tmp_path)
    found: Any = LOADERS["kept-seal"].read(path)
    assert found is None or found[0].start is None


def _lines(original: Original, change: Callable[[dict[str, Any]], object]) -> bytes:
    """The kept file with its second line changed."""
    lines = original.contents[0].decode().splitlines()
    reported = change(json.loads(lines[1]))
    lines[1] = reported if isinstance(reported, str) else json.dumps(reported)
    return ("\n".join(lines) + "\n").encode()


CHANGES: dict[str, Callable[[dict[str, Any]], object]] = {
    "nested without end": lambda line: NESTED,
    "a list": lambda line: [line],
    "a number that is a text": lambda line: line | {"number": "1"},
    "something more": lambda line: line | {"more": 1},
    "something less": lambda line: dict(list(line.items())[1:]),
}


@pytest.mark.parametrize("change", CHANGES)
def test_lines_that_are_no_trials_are_refused(change: str, tmp_path: Path) -> None:
    path = tmp_path / "kept.jsonl"
    readers: tuple[tuple[Original, Any], ...] = (
        (kept_draws(), read_draw),
        (kept_trials(), trial_reader()),
    )
    for original, read in readers:
        path.write_bytes(_lines(original, CHANGES[change]))
        with pytest.raises(InputError, match="is no list of trials"):
            known_trials(path, MARKS, read)
    path.write_bytes(_lines(kept_blind(), CHANGES[change]))
    with pytest.raises(InputError, match="is no list of trials"):
        read_blind(path)


@pytest.mark.parametrize(
    "change",
    [
        {"rank": {"mu_r": 3}},
        {"rank": {"x": 1}, "inside": {"x": True}},
        {"rank": {"mu_r": -1, "c_sd": 9}},
        {"rank": {"mu_r": 10**30, "c_sd": 9}},
        {"ess": float("nan")},
        {"inside": {"mu_r": 1}},
    ],
)
def test_trials_of_other_parameters_are_not_counted_together(change: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    path.write_bytes(_lines(kept_trials(), lambda line: line | change))
    with pytest.raises(InputError, match="is no list of trials"):
        known_trials(path, MARKS, trial_reader())


@pytest.mark.parametrize(
    "change", [{"verdict": "maybe"}, {"said": ["magic"]}, {"effects": [["accel_lag"]]}, {"kind": "effect"}]
)
def test_marks_about_something_unknown_are_refused(change: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    path.write_bytes(_lines(kept_blind(), lambda line: line | change))
    with pytest.raises(InputError, match="is no list of trials"):
        read_blind(path)


@pytest.mark.parametrize("seed", [-4, True, 4.0, None])
def test_a_seed_that_is_none_is_not_gone_on_with(seed: object, tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    lines = kept_blind().contents[0].decode().splitlines(keepends=True)
    path.write_text(json.dumps(json.loads(lines[0]) | {"seed": seed}) + "\n" + "".join(lines[1:]))
    with pytest.raises(InputError, match="holds trials of another seed"):
        read_blind(path)


@pytest.mark.parametrize(
    ("seal", "said"),
    [
        ("[]", "it is no table"),
        ("{}", "without is missing"),
        ('{"without": [], "seal": []}', "seal is a list, not a table"),
        ('{"without": [], "seal": {"answer": "a"}}', "seal.recordings is missing"),
        ('{"without": [3], "seal": {"answer": "a", "recordings": "b"}}', "not a text"),
        ('{"without": [], "seal": {"answer": "a", "recordings": "b"}}', "not the one that was sealed"),
        (NESTED, "is not what a trial leaves behind"),
    ],
)
def test_a_seal_that_is_none_is_refused_by_its_name(seal: str, said: str, tmp_path: Path) -> None:
    path = place(LOADERS["blind-seal"], seal.encode(), tmp_path)
    with pytest.raises(InputError) as caught:
        read_blind_seal(path)
    assert caught.value.source == str(path)
    assert said in caught.value.what


def test_the_seal_beside_those_is_good(tmp_path: Path) -> None:
    assert read_blind_seal(place(LOADERS["blind-seal"], blind_seal().contents[0], tmp_path))
