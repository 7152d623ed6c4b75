"""Shooting with finite differences, as a user of MATLAB would do it with ``ode45`` and ``fsolve``, by scipy.

The unknowns are the states with which a dwell's period begins; what is asked for is that it ends with them. MINPACK's
hybrid method differentiates by finite differences, LSODA integrates, and the right-hand side is ours, compiled. Each
dwell begins with the state of the next faster one, the fastest where the rig is after :data:`SETTLING_S`.
"""

import time
from collections.abc import Callable

import jax
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from benchmarks.by_scipy import integrate_dwell
from benchmarks.motion import STATE_SCALE, period_harmonics, state_rates
from benchmarks.outcome import Outcome, Progress
from benchmarks.task import TOLERANCE_PERCENT, Harmonics, Task, errors_percent

RightSide = Callable[[NDArray[np.float64], float, float], NDArray[np.float64]]
"""d(state)/dt from the state, the time [s] and the cam's angular speed [rad/s]."""

SETTLING_S = 0.5

STEP = 1e-3
"""Of the differences, relative to the typical size of each state [1]: the square root of LSODA's tolerance."""

CLOSE = 1e-4
"""Change of the states, relative to them, at which the search ends [1]. Like :data:`STEP` and :data:`SETTLING_S`
chosen by hand, for the most dwells within the tolerance."""


def measure(task: Task, reference: Harmonics, progress: Progress) -> Outcome:
    """Time of the dwells that reach the tolerance, and the error of those that do not."""
    rates = jax.jit(lambda state, t, omega: state_rates(task, state, omega * t, omega))
    np.asarray(rates(task.rest, 0.0, 1.0))

    def right_side(state: NDArray[np.float64], t: float, omega: float) -> NDArray[np.float64]:
        return np.asarray(rates(state, t, omega))

    fastest = float(task.frequency.max())
    settle = float(np.ceil(SETTLING_S * fastest))
    begin = integrate_dwell(right_side, task.rest, fastest, settle, (2.0 * np.pi * fastest,))[0]
    seconds, errors, periods = {}, {}, {}
    for dwell in np.argsort(-task.frequency):
        progress(f"shooting: {task.frequency[dwell]:g} Hz")
        began = time.perf_counter()
        states, count = _shot(right_side, begin, float(task.frequency[dwell]))
        seconds[dwell], periods[dwell] = time.perf_counter() - began, count
        response = period_harmonics_of(task, states, int(dwell))
        errors[dwell] = float(errors_percent(response, reference[dwell : dwell + 1])[0])
        if errors[dwell] <= TOLERANCE_PERCENT:
            begin = states[0]
    solved = [dwell for dwell, error in errors.items() if error <= TOLERANCE_PERCENT]
    missed = ", ".join(
        f"{task.frequency[d]:g} Hz {errors[d]:.2g} %" for d in sorted(set(errors) - set(solved))
    )
    each = np.mean(list(periods.values()))
    figures = {"shooting_dwells_solved": float(len(solved))}
    if solved:
        figures |= {
            "shooting_ms_per_frequency": 1e3 * float(np.mean([seconds[dwell] for dwell in solved])),
            "error_percent_shooting": max(errors[dwell] for dwell in solved),
        }
    return Outcome(
        figures,
        (
            f"shooting: LSODA and MINPACK's hybrid method with finite differences, {each:.0f} periods integrated "
            "for a dwell; the right-hand side is ours, compiled.",
            *([f"shooting: not within the tolerance at {missed}; these are not counted."] if missed else []),
        ),
    )


def period_harmonics_of(task: Task, states: NDArray[np.float64], dwell: int) -> Harmonics:
    """Harmonics of one dwell, (1, 2, 10), from the states of its period."""
    every = np.broadcast_to(states, (task.frequency.size, *states.shape))
    return period_harmonics(task, every)[dwell : dwell + 1]


def _shot(
    right_side: RightSide, begin: NDArray[np.float64], frequency: float
) -> tuple[NDArray[np.float64], int]:
    """The states of a period that ends where it begins, (1 + SAMPLES, x), and how many periods were integrated."""
    count = 0

    def period(start: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal count
        count += 1
        return integrate_dwell(right_side, start, frequency, 0.0, (2.0 * np.pi * frequency,))

    def missed(scaled: NDArray[np.float64]) -> NDArray[np.float64]:
        start = scaled * STATE_SCALE
        return (period(start)[-1] - start) / STATE_SCALE

    found = root(missed, begin / STATE_SCALE, method="hybr", options={"eps": STEP**2, "xtol": CLOSE})
    return period(found.x * STATE_SCALE), count
