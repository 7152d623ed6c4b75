"""The cross-check's figure: the largest distance of the four parameters in the fit's standard errors."""

from types import SimpleNamespace

import pytest

from benchmarks import cross_check
from benchmarks.cross_check import distances
from savgs_ident.core.status import Status
from savgs_ident.fit.estimate import Estimate
from savgs_ident.plants.quarter_car.model import FREE


def _estimate(name: str, value: float, stderr: float) -> Estimate:
    return Estimate(name, value, stderr, stderr, "1", True, 0.0, 0.0)


def test_distances_count_in_standard_errors_of_the_fit() -> None:
    known = {name: _estimate(name, 1.0, 0.1) for name in (*FREE, "k_pre")}
    found = {name: _estimate(name, 1.0, 5.0) for name in (*FREE, "k_pre")}
    found["c_sd"] = _estimate("c_sd", 0.97, 5.0)
    found["k_pre"] = _estimate("k_pre", 9.0, 5.0)
    assert distances(found, known) == pytest.approx({name: 0.3 if name == "c_sd" else 0.0 for name in FREE})


@pytest.mark.parametrize("status", [Status.CONVERGED, Status.NOT_FINITE])
def test_what_was_not_solved_is_not_compared(status: Status, monkeypatch: pytest.MonkeyPatch) -> None:
    known = SimpleNamespace(by_name={name: _estimate(name, 1.0, 0.1) for name in FREE})
    found = SimpleNamespace(
        by_name={name: _estimate(name, 1.02, 0.1) for name in FREE},
        status=status,
        wall_s=30.0,
        unknowns=9,
        iterations=5,
    )
    monkeypatch.setattr(cross_check, "fit_least_squares", lambda *given, **named: known)
    monkeypatch.setattr(cross_check, "fit_by_collocation", lambda *given, **named: found)
    outcome = cross_check.measure((6.0,), lambda line: None)
    compared = {"collocation_worst_sd": 0.2} if status.ok else {}
    assert dict(outcome.figures) == pytest.approx({"collocation_s": 30.0} | compared)
    assert ("NOT SOLVED" in outcome.notes[0]) == (not status.ok)
