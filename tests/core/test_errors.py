"""Messages say where, what and what to do, in that order; statuses know whether to be trusted."""

import pytest

from savgs_ident.core.errors import DataWarning, InputError, SavgsIdentError
from savgs_ident.core.status import Status


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


def test_a_warning_begins_with_its_code() -> None:
    warning = DataWarning("clipped_sensor", "stands at its limit", channel="sprung_accel")
    assert str(warning) == "[clipped_sensor] channel 'sprung_accel': stands at its limit."


@pytest.mark.parametrize("status", Status)
def test_only_a_converged_result_is_trusted(status: Status) -> None:
    assert status.ok == (status is Status.CONVERGED)
    assert status.advice.strip()
