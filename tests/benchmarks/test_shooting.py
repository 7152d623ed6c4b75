"""Shooting, as the benchmark does it, against a tight integration of the same dwell."""

import pytest

from benchmarks.by_diffrax import integrate_reference, make_integrator
from benchmarks.by_shooting import measure
from benchmarks.task import TOLERANCE_PERCENT, make_task

pytestmark = pytest.mark.slow


def test_the_resonance_is_found_within_the_tolerance() -> None:
    task = make_task((2.35,))
    outcome = measure(task, integrate_reference(task, make_integrator(task)), lambda line: None)
    assert outcome.figures["shooting_dwells_solved"] == 1.0
    assert outcome.figures["error_percent_shooting"] <= TOLERANCE_PERCENT
    assert outcome.figures["shooting_ms_per_frequency"] > 0.0
