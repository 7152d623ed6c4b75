"""Messages say where, what and what to do, in that order; statuses know whether to be trusted."""

import pytest

from savgs_ident.core.errors import DataWarning, InputError, SavgsIdentError, blamed_on
from savgs_ident.core.status import Status

from ..in_one_test import over


def test_an_error_says_place_fault_and_remedy() -> None:
    error = InputError(
        "time goes backwards", source="a.csv", test="dwell_2Hz", channel="time", time=1.5, remedy="sort it."
    )
    assert (
        str(error)
        == "a.csv, test 'dwell_2Hz', channel 'time', at 1.500 s: time goes backwards. Remedy: sort it."
    )
    assert isinstance(error, SavgsIdentError)
    assert str(InputError("no file given.")) == "no file given."


@over(
    "bad",
    ["two\nlines", "\x1b[31mred", "nul\x00", "\u2028", "\u202eleft", "\ud800", "x" * 10**6],
    ids=("two lines", "an escape", "a nul", "a separator", "a turn", "half a letter", "a million letters"),
)
def test_whatever_a_file_holds_a_message_is_one_line_that_can_be_read(bad: str) -> None:
    error = InputError(f"'{bad}' is odd", source="a.csv", test=bad, channel=bad, remedy=f"rename {bad}")
    assert str(error).isprintable()
    assert len(str(error)) < 3000
    assert str(error).startswith("a.csv, test '")
    assert error.what == f"'{bad}' is odd"


def test_letters_of_all_languages_stay() -> None:
    assert str(InputError("Stoßdämpfer 減衰 5\u202f000")) == "Stoßdämpfer 減衰 5\u202f000."


def test_an_error_without_a_file_gets_one() -> None:
    with pytest.raises(InputError) as caught, blamed_on("rig.toml"):
        raise InputError("is bad", channel="x", remedy="mend it")
    assert str(caught.value) == "rig.toml, channel 'x': is bad. Remedy: mend it."
    with pytest.raises(InputError) as caught, blamed_on("rig.toml"):
        raise InputError("is bad", source="other.toml")
    assert caught.value.source == "other.toml"


def test_a_warning_begins_with_its_code() -> None:
    warning = DataWarning("clipped_sensor", "stands at its limit", channel="sprung_accel")
    assert str(warning) == "[clipped_sensor] channel 'sprung_accel': stands at its limit."


@over("status", Status)
def test_only_a_converged_result_is_trusted(status: Status) -> None:
    assert status.ok == (status is Status.CONVERGED)
    assert status.advice.strip()
