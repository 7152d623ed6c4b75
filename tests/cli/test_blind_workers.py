"""Work in processes side by side: killed, wrong, and in the end."""

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.validation.trials import side_by_side


def doubled(marks: Path, kills: int, number: int) -> int:
    """Twice the number; the process that has number 3 in hand is killed so many times."""
    (marks / f"{number}.{len(list(marks.glob(f'{number}.*')))}").touch()
    if number == 3 and len(list(marks.glob("3.*"))) <= kills:
        os.kill(os.getpid(), signal.SIGKILL)
    return 2 * number


def refused(number: int) -> int:
    """No number is good."""
    raise InputError(f"{number} is no good", remedy="take another")


@pytest.mark.slow
def test_what_a_killed_process_had_in_hand_is_done_again(tmp_path: Path) -> None:
    assert sorted(side_by_side(partial(doubled, tmp_path, 1), [1, 2, 3, 4], 2)) == [2, 4, 6, 8]


@pytest.mark.slow
def test_what_is_killed_each_time_is_reported_when_the_others_are_done(tmp_path: Path) -> None:
    found: list[int] = []
    said = r"trial 3: its process was killed by signal 9, 3 times\. Remedy: run again"
    with pytest.raises(InputError, match=said):
        found.extend(side_by_side(partial(doubled, tmp_path, 9), [3, 1, 2], 2))
    assert sorted(found) == [2, 4]


def failed_checks_give(number: int) -> tuple[int, str]:
    """What a check of a compiled program gives where it fails, here."""
    return number, os.environ["EQX_ON_ERROR"]


@pytest.mark.slow
def test_a_failed_check_of_a_program_gives_nan_in_a_process_unless_the_user_says_otherwise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("EQX_ON_ERROR", raising=False)
    assert list(side_by_side(failed_checks_give, [1], 1)) == [(1, "nan")]
    assert "EQX_ON_ERROR" not in os.environ
    monkeypatch.setenv("EQX_ON_ERROR", "raise")
    assert list(side_by_side(failed_checks_give, [1], 1)) == [(1, "raise")]


def test_an_error_of_the_work_is_raised_here() -> None:
    with pytest.raises(InputError, match=r"is no good\. Remedy: take another\."):
        list(side_by_side(refused, [1, 2], 2))
