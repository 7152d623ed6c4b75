"""The cross-check's figure: the largest distance of the four parameters in the fit's standard errors."""

import pytest

from benchmarks.cross_check import distances
from savgs_ident.fit.least_squares import FREE
from savgs_ident.fit.result import Estimate


def _estimate(name: str, value: float, stderr: float) -> Estimate:
    return Estimate(name, value, stderr, "1", True, 0.0, 0.0)


def test_distances_count_in_standard_errors_of_the_fit() -> None:
    known = {name: _estimate(name, 1.0, 0.1) for name in (*FREE, "k_pre")}
    found = {name: _estimate(name, 1.0, 5.0) for name in (*FREE, "k_pre")}
    found["c_sd"] = _estimate("c_sd", 0.97, 5.0)
    found["k_pre"] = _estimate("k_pre", 9.0, 5.0)
    assert distances(found, known) == pytest.approx({name: 0.3 if name == "c_sd" else 0.0 for name in FREE})
