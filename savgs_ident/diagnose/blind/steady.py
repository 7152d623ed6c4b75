"""A steady cam by time integration: one period of the motion that a dwell comes to.

The rig starts at rest; the cam's lift grows to its height during the first second, and then its speed changes
from dwell to dwell, with the cam at its top each time. Every dwell runs until the states at the ends of two
stretches agree; then one period is kept. What follows in a dwell repeats that period; the sensors' own dynamics,
which are linear, act on its harmonics.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.model.actuation import ImposedLink, held_link
from savgs_ident.model.dynamics import Coordinates
from savgs_ident.model.effect import AbstractSensorFault
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.road import RoadMotion, cam_road, flat_road
from savgs_ident.model.values import Values
from savgs_ident.simulate.stored import placed
from savgs_ident.simulate.transient import STATE_SCALE, RigState, rest_state, simulate_transient

SAMPLES = 2048
"""Instants of the period that is kept: a millisecond apart in the slowest dwell of the programme."""

STRETCH = 1.0
"""A stretch is so many whole periods that it lasts at least this long [s]."""

CLOSED = 2e-4
"""Two ends agree if no state differs by more than this of its typical size: a tenth of what the noise of a dwell
leaves open, and about what the steps of the integration scatter by."""

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
    mechanics = without_sensor_faults(model)
    state, rise = _at_rest(mechanics, p, placed(held_link(float(p["psi_nominal"])))), STRETCH
    for frequency in frequencies:
        apart = np.inf
        for _ in range(ceil(PATIENCE / STRETCH)):
            before, state = (
                state,
                _stretch(mechanics, p, state, frequency, ceil(STRETCH * frequency), rise)[0],
            )
            apart, rise = _apart(mechanics, before, state), 0.0
            if apart < CLOSED or np.isnan(apart):
                break
        state, truth = _stretch(mechanics, p, state, frequency, 1, rise)
        yield Steady(frequency, _shown(model, p, frequency, truth), bool(apart < CLOSED))


def _apart(model: QuarterCar, before: Array, after: Array) -> float:
    """Largest difference of two packed states, of their typical sizes; NaN if one is not a number."""
    scale = np.array([*STATE_SCALE, *(state.scale for state in model.states)])
    return float(np.max(np.abs(np.asarray(after) - np.asarray(before)) / scale))


def _stretch(
    model: QuarterCar, p: Values, start: Array, frequency: float, periods: int, rise: float
) -> tuple[Array, NDArray[np.float64]]:
    """The packed state after so many periods, and what was read on the way, (2, SAMPLES).

    The cam's lift grows to its height during the first ``rise`` [s].
    """
    lift, angle = float(p["cam_peak_to_peak"]), float(p["psi_nominal"])
    times = np.linspace(0.0, periods / frequency, SAMPLES + 1)
    drive = (cam_road(lift, frequency, rise), held_link(angle), jnp.asarray(times))
    end, readings = _integrated(model, p, start, *placed(drive))
    return end, np.asarray(readings)


@eqx.filter_jit
def _at_rest(model: QuarterCar, p: Values, link: ImposedLink) -> Array:
    return _packed(rest_state(model, p, flat_road(), link, jnp.zeros(())))


# Compiled as a whole: what prepares an integration would take longer than the integration, step by step.
@eqx.filter_jit
def _integrated(
    model: QuarterCar, p: Values, start: Array, road: RoadMotion, link: ImposedLink, times: Array
) -> tuple[Array, Array]:
    found = simulate_transient(model, p, road, link, times, _unpacked(start), PRECISION)
    return _packed(found.state_at(-1)), jnp.stack(found.readings)[:, :-1]


def _packed(state: RigState) -> Array:
    return jnp.concatenate([jnp.stack([*state.q, *state.qd]), state.s])


def _unpacked(x: Array) -> RigState:
    return RigState(Coordinates(x[0], x[1]), Coordinates(x[2], x[3]), x[4:], jnp.zeros(0))


@eqx.filter_jit
def _transfers(model: QuarterCar, p: Values, frequency: Array) -> Array:
    return model.transfers(p, frequency)


def _shown(model: QuarterCar, p: Values, frequency: float, truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the sensors make of a period."""
    order = jnp.arange(SAMPLES // 2 + 1, dtype=jnp.float64)
    passed = np.asarray(_transfers(model, p, frequency * order))
    return np.fft.irfft(np.fft.rfft(truth) * passed, SAMPLES)
