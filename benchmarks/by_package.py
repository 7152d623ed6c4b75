"""This package: periodic collocation of all dwells at once."""

import statistics

import numpy as np

from benchmarks.outcome import Outcome
from benchmarks.task import ORDERS, PARAMETERS, Harmonics, Task, errors_percent
from benchmarks.timing import median_time, timed
from savgs_ident.simulate.periodic import PeriodicSolution, resolve, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import harmonics_with_sensitivities

REPEATS = 15
CHANGE = 1.01
"""Warm starts begin this far from the answer, in each of the four parameters."""


def measure(task: Task, reference: Harmonics) -> Outcome:
    """Cold start, warm start, and the warm start with the gradient, whose time is added to the cold one, too."""
    excitation, dwells = task.excitation, task.frequency.size
    moved = task.values | {name: CHANGE * task.values[name] for name in PARAMETERS}

    def cold() -> tuple[PeriodicSolution, object]:
        solution = simulate_periodic(task.model, task.values, excitation)
        return solution, harmonics(task.model, task.values, solution, ORDERS)

    (start, response), first_s = timed(cold)
    cold_s = median_time(cold, REPEATS)

    def value() -> tuple[PeriodicSolution, object]:
        solution = resolve(task.model, moved, start)
        return solution, harmonics(task.model, moved, solution, ORDERS)

    def with_gradient() -> object:
        solution = resolve(task.model, moved, start)
        return harmonics_with_sensitivities(task.model, moved, solution, PARAMETERS, ORDERS)

    _, first_value_s = timed(value)
    _, first_gradient_s = timed(with_gradient)
    # In turn, so that whatever else the machine does falls on both alike.
    pairs = [(timed(value)[1], timed(with_gradient)[1]) for _ in range(REPEATS)]
    warm_s, both_s = (statistics.median(column) for column in zip(*pairs, strict=True))
    gradient_s = both_s - warm_s
    stuck = [f"{f:g} Hz" for f, s in zip(task.frequency, start.status(), strict=True) if not s.ok]
    return Outcome(
        {
            "response_ms_per_frequency": 1e3 * cold_s / dwells,
            "response_warm_ms_per_frequency": 1e3 * warm_s / dwells,
            "gradient_over_value": statistics.median(both / alone for alone, both in pairs),
            "gradient_over_value_cold": 1.0 + gradient_s / cold_s,
            "response_compile_s": first_s - cold_s,
            "gradient_compile_s": first_value_s + first_gradient_s - warm_s - both_s,
            "error_percent_ours": float(errors_percent(np.asarray(response), reference).max()),
        },
        (f"ours: not converged at {', '.join(stuck)}",) if stuck else (),
    )
