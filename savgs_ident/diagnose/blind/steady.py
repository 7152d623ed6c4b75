"""A steady cam by time integration: one period of the motion that a dwell comes to.

The rig is started at rest on the first dwell and goes from one dwell to the next as on the stand, with the cam
at its top each time. It runs until the states at the ends of two stretches agree; then one period is kept. What
follows in a dwell repeats that period; the sensors' own dynamics, which are linear, act on its harmonics.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.model.actuation import held_link
from savgs_ident.model.dynamics import Coordinates
from savgs_ident.model.effect import AbstractSensorFault
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.road import cam_road, flat_road
from savgs_ident.model.values import Values
from savgs_ident.simulate.stored import placed
from savgs_ident.simulate.transient import STATE_SCALE, RigState, rest_state, simulate_transient

SAMPLES = 2048
"""Instants of the period that is kept: a millisecond apart in the slowest dwell of the programme."""

STRETCH = 1.0
"""A stretch is so many whole periods that it lasts at least this long [s]."""

CLOSED = 3e-5
"""Two ends agree if no state differs by more than this of its typical size."""

PATIENCE = 60.0
"""A dwell that has not settled after so long [s] does not."""

PRECISION = 1e-6
"""Relative tolerance of a step of the integration."""


@dataclass(frozen=True)
class Steady:
    """A steady dwell.

    Attributes:
        frequency: [Hz].
        readings: what the sensors show over a period that begins with the cam at its top, noise apart: [m/s^2]
            and [m], (2, SAMPLES).
        settled: whether the motion had become periodic.
    """

    frequency: float
    readings: NDArray[np.float64]
    settled: bool


def without_sensor_faults(model: QuarterCar) -> QuarterCar:
    """The same rig with sensors that show what is there, gains apart."""
    return QuarterCar(
        model.damper, tuple(each for each in model.effects if not isinstance(each, AbstractSensorFault))
    )


def steady_dwells(model: QuarterCar, p: Values, frequencies: tuple[float, ...]) -> Iterator[Steady]:
    """The steady motions of the rig in one dwell after the other [Hz], with a link held at its nominal angle."""
    mechanics, end = without_sensor_faults(model), None
    for frequency in frequencies:
        for _ in range(ceil(PATIENCE / STRETCH)):
            start, end = end, _stretch(mechanics, p, frequency, ceil(STRETCH * frequency), end)[0]
            settled = start is not None and _apart(mechanics, start, end) < CLOSED
            if settled:
                break
        end, truth = _stretch(mechanics, p, frequency, 1, end)
        yield Steady(frequency, _shown(model, p, frequency, truth), settled)


def _apart(model: QuarterCar, start: Array, end: Array) -> float:
    """Largest difference of two packed states, of their typical sizes; infinite if one is not a number."""
    scale = np.array([*STATE_SCALE, *(state.scale for state in model.states)])
    apart = float(np.max(np.abs(np.asarray(end) - np.asarray(start)) / scale))
    return apart if np.isfinite(apart) else np.inf


def _stretch(
    model: QuarterCar, p: Values, frequency: float, periods: int, start: Array | None
) -> tuple[Array, NDArray[np.float64]]:
    """The packed state after so many periods, and what was read on the way, (2, SAMPLES)."""
    rising = start is None
    begin = _at_rest(model, p) if start is None else start
    numbers = (frequency, periods / frequency, STRETCH if rising else 0.0)
    end, readings = _integrated(model, p, begin, placed(jnp.asarray(numbers, jnp.float64)))
    return end, np.asarray(readings)


@eqx.filter_jit
def _at_rest(model: QuarterCar, p: Values) -> Array:
    link = held_link(p["psi_nominal"])
    return _packed(rest_state(model, p, flat_road(), link, jnp.zeros(())))


@eqx.filter_jit
def _integrated(*args: Any) -> tuple[Array, ...]:
    return _integrate(*args)


def _integrate(model: QuarterCar, p: Values, start: Array, numbers: Array) -> tuple[Array, Array]:
    frequency, duration, rise = jnp.unstack(numbers)
    road = cam_road(p["cam_peak_to_peak"], frequency, rise)
    times = duration * jnp.arange(SAMPLES + 1) / SAMPLES
    found = simulate_transient(
        model, p, road, held_link(p["psi_nominal"]), times, _unpacked(start), PRECISION
    )
    return _packed(found.state_at(-1)), jnp.stack(found.readings)[:, :-1]


def _packed(state: RigState) -> Array:
    return jnp.concatenate([jnp.stack([*state.q, *state.qd]), state.s])


def _unpacked(x: Array) -> RigState:
    return RigState(Coordinates(x[0], x[1]), Coordinates(x[2], x[3]), x[4:], jnp.zeros(0))


@eqx.filter_jit
def _transfers(model: QuarterCar, p: Values, frequency: Array) -> Array:
    return model.transfers(p, frequency)


def _shown(
    model: QuarterCar, p: Values, frequency: float, truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What the sensors make of a period."""
    order = jnp.arange(SAMPLES // 2 + 1, dtype=jnp.float64)
    passed = np.asarray(_transfers(model, p, frequency * order))
    return np.fft.irfft(np.fft.rfft(truth) * passed, SAMPLES)
