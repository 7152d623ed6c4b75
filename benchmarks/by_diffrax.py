"""diffrax: time integration to the steady state, all dwells side by side. It gives the reference too.

Tsitouras' explicit method of order five: the rig is not stiff enough for implicit ones to pay. Dwells run
vectorised, each with steps of its own; one after the other takes several times longer.
"""

from collections.abc import Callable
from typing import Any

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from benchmarks.motion import SAMPLES, STATE_SCALE, period_harmonics, settling_periods, state_rates
from benchmarks.outcome import Outcome
from benchmarks.task import Harmonics, Task, errors_percent
from benchmarks.timing import median_time, timed

Integrate = Callable[[Array, Array, Array], tuple[Array, Array]]
"""Frequencies [Hz], periods and tolerance to states in the last period, (D, 1 + SAMPLES, x), and steps, (D,)."""

SETTLING_S = 2.1
TOLERANCE = 1e-6
"""Settling [s] and tolerance chosen by hand, near the least that holds 0.1 % in every dwell."""

REFERENCE_SETTLING_S = 8.0
REFERENCE_TOLERANCE = 1e-9
REPEATS = 3
MOST_STEPS = 2_000_000


def make_integrator(task: Task) -> Integrate:
    """The compiled integration."""

    def one(frequency: Array, periods: Array, tolerance: Array) -> tuple[Array, Array]:
        omega = 2.0 * jnp.pi * frequency

        def rates(turns: Any, state: Any, args: None) -> Any:
            return state_rates(task, state, 2.0 * jnp.pi * turns, omega) / frequency

        solution = dfx.diffeqsolve(
            dfx.ODETerm(rates),
            dfx.Tsit5(),
            0.0,
            periods,
            1e-4 * frequency,
            jnp.asarray(task.rest),
            saveat=dfx.SaveAt(ts=periods - 1.0 + jnp.arange(SAMPLES + 1) / SAMPLES),
            stepsize_controller=dfx.PIDController(
                rtol=tolerance, atol=tolerance * jnp.asarray(STATE_SCALE), pcoeff=0.2, icoeff=0.4
            ),
            max_steps=MOST_STEPS,
            throw=False,
        )
        return solution.ys, solution.stats["num_steps"]

    compiled: Integrate = jax.jit(jax.vmap(one, in_axes=(0, 0, None)))
    return compiled


def _run(task: Task, integrate: Integrate, settling_s: float, tolerance: float) -> tuple[Array, Array]:
    periods = settling_periods(task.frequency, settling_s) + 1.0
    return integrate(jnp.asarray(task.frequency), jnp.asarray(periods), jnp.asarray(tolerance))


def integrate_reference(task: Task, integrate: Integrate) -> Harmonics:
    """The response that all methods are compared with: tight steps, long settling."""
    states, _ = _run(task, integrate, REFERENCE_SETTLING_S, REFERENCE_TOLERANCE)
    return period_harmonics(task, np.asarray(states))


def measure(task: Task, integrate: Integrate, reference: Harmonics) -> Outcome:
    """Time and error at the chosen tolerance."""

    def work() -> tuple[Array, Array]:
        return _run(task, integrate, SETTLING_S, TOLERANCE)

    (states, steps), _ = timed(work)
    seconds = median_time(work, REPEATS)
    errors = errors_percent(period_harmonics(task, np.asarray(states)), reference)
    return Outcome(
        {
            "diffrax_ms_per_frequency": 1e3 * seconds / task.frequency.size,
            "error_percent_diffrax": float(errors.max()),
        },
        (
            f"diffrax: Tsit5, tolerance {TOLERANCE:g}, settling {SETTLING_S:g} s and one period more, "
            f"{float(np.mean(steps)):.0f} steps a dwell; right-hand side ours, compiled, dwells vectorised.",
        ),
    )
