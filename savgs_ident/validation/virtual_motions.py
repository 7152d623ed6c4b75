"""Motions of the rig by integration in time, from rest: steady dwells of the cam, and a sweep.

What a trial records comes from here, not from the collocation that models are fitted with. Every dwell begins with
the rig at rest, and the cam's lift grows to its height during the first second. It runs until the states at the ends
of two stretches agree; then one period is kept. What follows in a dwell repeats that period; the sensors' own
dynamics, which are linear, act on its harmonics. All dwells are integrated side by side, each with steps of its own:
one after the other they take three to five times as long.

The integration controls its error, or has a fixed step: the truth of foreign trials is integrated by the classical
method of Runge and Kutta (``_stepped``), the accelerations at every stage being the root of the plant's
residual. So it shares no method with the diagnosis nor with other virtual campaigns.

Source: Kutta 1901, Zeitschrift fuer Mathematik und Physik 46.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from diffrax import RESULTS
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.status import Status, joint_status
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSensorLaw
from savgs_ident.plants.at_rest import nominal_readings
from savgs_ident.plants.base import AbstractPlant, AbstractSource, Motion, state_sizes
from savgs_ident.plants.quarter_car.inputs import (
    ImposedLink,
    RigSource,
    RoadMotion,
    cam_road,
    flat_road,
    held_link,
    nominal_test,
    sweep_road,
)
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.program_cache import placed, run_cached
from savgs_ident.simulate.transient import (
    PlantState,
    pack_state,
    rest_state,
    simulate_transient,
    state_rates,
    through_sensors,
    unpack_state,
)

SAMPLES = 2048
"""Instants of the period that is kept: a millisecond apart in the slowest dwell of the programme."""

STRETCH = 1.0
"""A stretch is so many whole periods that it lasts at least this long [s]."""

CLOSED = 2e-4
"""Two ends agree if no state differs by more than this of its typical size: a tenth of what the noise of a dwell
leaves open, and about what the steps of the integration scatter by."""

PATIENCE = 60.0
"""A dwell that is not periodic after so long [s] does not become so."""

PRECISION = 1e-6
"""Relative tolerance of a step of the integration."""


@dataclass(frozen=True)
class Steady:
    """A steady dwell.

    Attributes:
        frequency: [Hz].
        readings: what the sensors show over a period that begins with the cam at its top, noise apart: [m/s^2]
            and [m], (2, SAMPLES).
        status: whether the motion was found and had become periodic.
    """

    frequency: float
    readings: NDArray[np.float64]
    status: Status


def without_sensor_faults(model: QuarterCar) -> QuarterCar:
    """The same rig with sensors that show what is there, gains apart."""
    return QuarterCar(
        model.damper,
        effects=tuple(each for each in model.effects if not isinstance(each.law, AbstractSensorLaw)),
    )


class _Dwells(NamedTuple):
    """D dwells: parameters [SI], frequencies [Hz], the cam's lift [m], and the link's angle [rad], (D,) each."""

    p: Values
    frequency: Float[Array, " D"]
    lift: Float[Array, " D"]
    angle: Float[Array, " D"]

    def source(self, rise: Array) -> RigSource:
        """What drives one of them; the lift grows to its height during the first ``rise`` [s]."""
        return RigSource(cam_road(self.lift, self.frequency, rise), held_link(self.angle))


class _Stretch(NamedTuple):
    """Packed states at the end, (D, x), and readings on the way, (D, C, n), in SI, and how it ended, (D,).

    ``stopped`` is whether it took too many steps, ``ok`` whether the integration says that it is right.
    """

    end: NDArray[np.float64]
    readings: NDArray[np.float64]
    stopped: NDArray[np.bool_]
    ok: NDArray[np.bool_]

    def statuses(self) -> list[Status]:
        """How each dwell ended."""
        finite = np.isfinite(self.end).all(axis=1) & np.isfinite(self.readings).all(axis=(1, 2))
        return [_ended(*each) for each in zip(self.stopped, self.ok & finite, strict=True)]


def _ended(stopped: bool, well: bool) -> Status:
    """How an integration ended that took too many steps, or did not and gave numbers that are right."""
    return Status.MAX_ITERATIONS if stopped else Status.CONVERGED if well else Status.NOT_FINITE


def steady_dwells(
    model: QuarterCar, during: Sequence[Values], frequencies: tuple[float, ...], step: float = 0.0
) -> list[Steady]:
    """The steady motions of the rig in dwells [Hz], with a link held at its nominal angle.

    ``during`` are the parameters [SI] in each; ``step`` [s] is that of a fixed-step integration, 0 for one that
    controls its error.
    """
    mechanics, hertz = without_sensor_faults(model), np.array(frequencies)
    stacked = {name: jnp.stack([jnp.asarray(each[name]) for each in during]) for name in during[0]}
    lift, angle = np.array([nominal_test(each) for each in during]).T
    dwells = placed(_Dwells(stacked, jnp.asarray(hertz), jnp.asarray(lift), jnp.asarray(angle)))
    rest = np.asarray(_all_at_rest(mechanics, dwells))
    state, rise = rest, STRETCH
    settled, status = np.zeros(hertz.size, np.bool_), [Status.MAX_ITERATIONS] * hertz.size
    for _ in range(ceil(PATIENCE / STRETCH)):
        along = _stretch(mechanics, dwells, state, np.ceil(STRETCH * hertz), rise, step)
        ended = along.statuses()
        failed = np.array([not each.ok for each in ended])
        new = ~settled & (failed | (_apart(mechanics, state, along.end) < CLOSED))
        status = [there if now else known for there, now, known in zip(ended, new, status, strict=True)]
        # Those that are lost begin again: the others need not wait for steps that lead nowhere.
        settled, state, rise = settled | new, np.where(failed[:, None], rest, along.end), 0.0
        if settled.all():
            break
    kept = _stretch(mechanics, dwells, state, np.ones(hertz.size), rise, step)
    dwell = zip(frequencies, during, kept.readings, status, kept.statuses(), strict=True)
    return [Steady(f, _shown(model, p, f, truth), joint_status(how)) for f, p, truth, *how in dwell]


@eqx.filter_jit
def _all_at_rest(model: QuarterCar, dwells: _Dwells) -> Array:
    def one(dwell: _Dwells) -> Array:
        return _at_rest(model, dwell.p, held_link(dwell.angle))

    return jax.vmap(one)(dwells)


def _apart(model: QuarterCar, before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest difference of packed states in each dwell, of their typical sizes, (D,)."""
    scale = np.array(state_sizes(model))
    return np.asarray(np.max(np.abs(after - before) / scale, axis=1))


def _stretch(
    model: QuarterCar,
    dwells: _Dwells,
    start: NDArray[np.float64],
    periods: NDArray[np.float64],
    rise: float,
    step: float,
) -> _Stretch:
    """So many periods of every dwell, (D,), from packed states, (D, x), with readings at :data:`SAMPLES` instants.

    The cam's lift grows to its height during the first ``rise`` [s].
    """
    durations = periods / np.asarray(dwells.frequency)
    begin, lasts, rising = placed((jnp.asarray(start), jnp.asarray(durations), jnp.asarray(rise)))
    if step > 0.0:
        inner = jnp.asarray([substeps_for(each, SAMPLES, step) for each in durations.tolist()])
        end, readings = map(np.asarray, _all_stepped(model, dwells, begin, lasts, rising, placed(inner)))
        return _Stretch(end, readings, stopped=np.zeros(len(end), bool), ok=np.ones(len(end), bool))
    return _Stretch(*map(np.asarray, _all_integrated(model, dwells, begin, lasts, rising)))


@eqx.filter_jit
def _all_stepped(*args: Any) -> tuple[Array, ...]:
    return run_cached(_step_all, *args)


def _step_all(
    model: QuarterCar, dwells: _Dwells, start: Array, duration: Array, rise: Array, inner: Array
) -> tuple[Array, ...]:
    def one(dwell: _Dwells, start: Array, duration: Array, inner: Array) -> tuple[Array, Array]:
        return _stepped(model, dwell.p, start, dwell.source(rise), duration / SAMPLES, inner, SAMPLES)

    return jax.vmap(one)(dwells, start, duration, inner)


# Compiled as a whole: what prepares an integration would take longer than the integration, step by step. It cannot be
# kept: it calls back to Python where an error is found.
@eqx.filter_jit
def _all_integrated(
    model: QuarterCar, dwells: _Dwells, start: Array, duration: Array, rise: Array
) -> tuple[Array, ...]:
    def one(dwell: _Dwells, start: Array, duration: Array) -> tuple[Array, ...]:
        times, begin = jnp.linspace(0.0, duration, SAMPLES + 1), unpack_state(model, start)
        found = simulate_transient(model, dwell.p, dwell.source(rise), times, begin, PRECISION)
        ends = (RESULTS.max_steps_reached, RESULTS.successful)
        how = (jnp.asarray(found.result == each) for each in ends)
        return pack_state(found.state_at(-1)), jnp.stack(found.readings)[:, :-1], *how

    return jax.vmap(one)(dwells, start, duration)


def _status_of(found: RESULTS, *numbers: Array) -> Status:
    """How an integration of controlled error ended that gave these numbers."""
    finite = all(bool(jnp.isfinite(each).all()) for each in numbers)
    return _ended(bool(found == RESULTS.max_steps_reached), bool(found == RESULTS.successful) and finite)


@eqx.filter_jit
def _at_rest(model: QuarterCar, p: Values, link: ImposedLink) -> Array:
    return pack_state(rest_state(model, p, RigSource(flat_road(), link), jnp.zeros(())))


@eqx.filter_jit
def _transfers(model: QuarterCar, p: Values, frequency: Array) -> Array:
    return model.transfers(p, frequency)


def _shown(model: QuarterCar, p: Values, frequency: float, truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the sensors make of a period."""
    order = jnp.arange(SAMPLES // 2 + 1, dtype=jnp.float64)
    passed = np.asarray(_transfers(model, p, frequency * order))
    return np.fft.irfft(np.fft.rfft(truth) * passed, SAMPLES)


def sweep_readings(
    model: QuarterCar, p: Values, duration: float, end: float, rate: float, step: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Instants [s], (n,), and what the sensors show then, (2, n), from 0 to ``end`` [Hz] in ``duration`` [s].

    ``step`` [s] is that of a fixed-step integration, 0 for one that controls its error.
    Raises :class:`InputError` if the integration does not end well.
    """
    times = np.arange(round(duration * rate) + 1) / rate
    lift, angle = nominal_test(p)
    road, link = sweep_road(lift, 0.0, end, duration), held_link(angle)
    if step > 0.0:
        shown, status = _swept_fixed(model, p, RigSource(road, link), times, step)
    else:
        shown, found = _swept(model, p, *placed((road, link, jnp.asarray(times))))
        status = _status_of(found, shown)
    if not status.ok:
        raise InputError("the sweep cannot be simulated", source="sweep", remedy="draw another rig")
    return times, np.asarray(shown)


def _swept_fixed(
    model: QuarterCar, p: Values, source: RigSource, times: NDArray[np.float64], step: float
) -> tuple[Array, Status]:
    """Readings (2, n) at evenly spaced instants [s], and how the integration ended."""
    start, lasts = _at_rest(model, p, placed(source.link)), float(times[-1]) * times.size / (times.size - 1)
    _, readings, status = integrate_fixed(model, p, start, placed(source), lasts, times.size, step)
    return through_sensors(partial(model.transfers, p), jnp.asarray(times), readings), status


@eqx.filter_jit
def _swept(
    model: QuarterCar, p: Values, road: RoadMotion, link: ImposedLink, times: Array
) -> tuple[Array, RESULTS]:
    found = simulate_transient(model, p, RigSource(road, link), times, tolerance=PRECISION)
    return jnp.stack(found.readings), found.result


State = Float[Array, " x"]


def substeps_for(duration: float, samples: int, step: float) -> int:
    """Steps from one of the ``samples`` of a ``duration`` [s] to the next, none longer than ``step`` [s]."""
    return max(1, ceil(duration / samples / step))


def integrate_fixed(
    model: AbstractPlant,
    p: Values,
    start: State,
    source: AbstractSource,
    duration: float,
    samples: int,
    step: float,
) -> tuple[State, Float[Array, "C n"], Status]:
    """The packed state after a ``duration`` [s], the readings at its n ``samples``, in SI, and how it ended.

    The samples are evenly spaced from its beginning; no step is longer than ``step`` [s]. Without control of the
    error it ends well if all numbers are finite, which they are not where there is no motion.
    """
    inner = substeps_for(duration, samples, step)
    interval, steps = placed((jnp.asarray(duration / samples), jnp.asarray(inner)))
    end, readings = _stepped(model, p, start, source, interval, steps, samples)
    finite = bool(jnp.isfinite(end).all() & jnp.isfinite(readings).all())
    return end, readings, _ended(stopped=False, well=finite)


@eqx.filter_jit
def _stepped(
    model: AbstractPlant,
    p: Values,
    start: State,
    source: AbstractSource,
    interval: Array,
    inner: Array,
    samples: int,
) -> tuple[State, Array]:
    prepared, size = model.prepare(p), len(model.coordinates)
    zeros, h = nominal_readings(model, p, prepared), interval / inner.astype(interval.dtype)

    def rate(t: Array, x: State, near: Array) -> tuple[State, Array]:
        """Rates of the packed state, and the accelerations and rates from which the next are found sooner."""
        now = state_rates(model, p, source, t, unpack_state(model, x), prepared, near)
        return pack_state(now), jnp.concatenate([pack_state(now)[size : 2 * size], now.s])

    def advance(t: Array, x: State, near: Array) -> tuple[State, Array]:
        def stage(
            held: tuple[State, State, Array], way: tuple[Array, Array]
        ) -> tuple[tuple[State, State, Array], None]:
            last, summed, near = held
            after, weight = way
            now, near = rate(t + after, x + after * last, near)
            return (now, summed + weight * now, near), None

        # A loop, not four copies of the equations of motion: those would take the compiler four times as long.
        none = jnp.zeros_like(x)
        ways = (jnp.stack([0.0 * h, h / 2.0, h / 2.0, h]), jnp.asarray([1.0, 2.0, 2.0, 1.0]))
        (_, summed, near), _ = jax.lax.scan(stage, (none, none, near), ways)
        return x + h / 6.0 * summed, near

    def sample(carried: tuple[State, Array], i: Array) -> tuple[tuple[State, Array], Array]:
        t = i * interval
        near = rate(t, *carried)[1]
        shown = _readings(model, p, source, t, unpack_state(model, carried[0]), near, prepared)
        steps = (carried[0], near)
        end = jax.lax.fori_loop(0, inner, lambda k, at: advance(t + k.astype(h.dtype) * h, *at), steps)
        return end, shown - jnp.stack(zeros)

    guess = jnp.zeros(size + len(model.states))
    (end, _), readings = jax.lax.scan(sample, (start, guess), jnp.arange(samples, dtype=jnp.float64))
    return end, readings.T


def _readings(
    model: AbstractPlant,
    p: Values,
    source: AbstractSource,
    t: Array,
    now: PlantState,
    rates: Array,
    prepared: object,
) -> Float[Array, " C"]:
    """What the sensors show if none has dynamics; ``rates`` are accelerations and rates of internal states."""
    size = len(model.coordinates)
    motion = Motion(now.q, now.qd, model.coordinate_type(*jnp.unstack(rates[:size])))
    u = source.inputs(model, t, now.source)
    return jnp.stack(model.read(p, motion, now.s, rates[size:], u, prepared))
