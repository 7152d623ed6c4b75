"""scipy: LSODA from rest to the steady state, dwell by dwell.

``odeint`` is scipy's quickest way to LSODA: its loop is Fortran, only the right-hand side is called back. That
is ours, compiled; what such a call costs beside what it computes is measured too.
"""

import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import odeint

from benchmarks.motion import SAMPLES, STATE_SCALE, period_harmonics, settling_periods, state_rates
from benchmarks.outcome import Outcome, Progress
from benchmarks.task import Harmonics, Task, errors_percent
from benchmarks.timing import timed

SETTLING_S = 2.1
TOLERANCE = 1e-5
"""Settling [s] and tolerance chosen by hand, near the least that holds 0.1 % in every dwell."""

MOST_STEPS = 1_000_000
_INSIDE = 20_000


def measure(task: Task, reference: Harmonics, progress: Progress) -> Outcome:
    """Time and error of all dwells."""
    rates = jax.jit(lambda state, t, omega: state_rates(task, state, omega * t, omega))
    np.asarray(rates(task.rest, 0.0, 1.0))
    calls, states = 0, []

    def right_side(state: np.ndarray, t: float, omega: float) -> np.ndarray:
        nonlocal calls
        calls += 1
        return np.asarray(rates(state, t, omega))

    began = time.perf_counter()
    for frequency, periods in zip(task.frequency, settling_periods(task.frequency, SETTLING_S), strict=True):
        progress(f"scipy: {frequency:g} Hz")
        omega = 2.0 * np.pi * frequency
        states.append(integrate_dwell(right_side, task.rest, frequency, periods, (omega,)))
    seconds, dwells = time.perf_counter() - began, task.frequency.size
    errors = errors_percent(period_harmonics(task, np.stack(states)), reference)
    inside_us = _cost_inside(task)
    bound = 1e-3 * inside_us * calls / dwells
    return Outcome(
        {
            "scipy_ms_per_frequency": 1e3 * seconds / dwells,
            "error_percent_scipy": float(errors.max()),
            "scipy_calls_per_frequency": calls / dwells,
            "scipy_call_us": 1e6 * seconds / calls,
            "scipy_bound_ms_per_frequency": bound,
        },
        (
            f"scipy: LSODA (odeint), tolerance {TOLERANCE:g}, settling {SETTLING_S:g} s and one period more; "
            "the right-hand side is ours, compiled by JAX and called back from Fortran.",
            f"scipy: within a compiled loop the same right-hand side takes {inside_us:.1f} us; the bound counts "
            "that alone, times the calls.",
        ),
    )


def integrate_dwell(
    right_side: Callable[..., NDArray[np.float64]],
    rest: NDArray[np.float64],
    frequency: float,
    periods: float,
    given: tuple[object, ...],
) -> NDArray[np.float64]:
    """States over one period after so many ``periods`` from ``rest``, (1 + SAMPLES, x).

    ``right_side`` (state, t, *given) is d(state)/dt in a dwell at ``frequency`` [Hz].
    """
    instants = np.append(0.0, (periods + np.arange(SAMPLES + 1) / SAMPLES) / frequency)
    found: NDArray[np.float64] = odeint(
        right_side,
        rest,
        instants,
        args=given,
        rtol=TOLERANCE,
        atol=TOLERANCE * STATE_SCALE,
        mxstep=MOST_STEPS,
    )
    return found[1:]


def _cost_inside(task: Task) -> float:
    """Time of one right-hand side within a compiled loop [us]."""

    def step(i: int, state: jax.Array) -> jax.Array:
        return state + 1e-9 * state_rates(task, state, jnp.asarray(1e-3 * i), jnp.asarray(10.0))

    loop = jax.jit(lambda state: jax.lax.fori_loop(0, _INSIDE, step, state))
    timed(lambda: loop(task.rest))
    return 1e6 * timed(lambda: loop(task.rest))[1] / _INSIDE
