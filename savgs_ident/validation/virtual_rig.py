"""The rig on which trials are drawn: its model with any effects, and what it answers to the programme.

Effects without states are in every model, those that were not drawn at their null, so that one compiled program
serves nearly all trials; an effect with states of its own asks for another.

What is recorded in a trial: the programme of dwells, seen by the rig's sensors
(:mod:`savgs_ident.validation.sensor_chain`).

A steady cam by time integration: one period of the motion that a dwell comes to.

The rig starts at rest; the cam's lift grows to its height during the first second, and then its speed changes
from dwell to dwell, with the cam at its top each time. Every dwell runs until the states at the ends of two
stretches agree; then one period is kept. What follows in a dwell repeats that period; the sensors' own dynamics,
which are linear, act on its harmonics.

A sweep of the cam from rest, by time integration.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import ceil

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from diffrax import RESULTS
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import AbstractSensorLaw
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.base import Excitation, state_sizes
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.forces import damper_curve
from savgs_ident.plants.quarter_car.inputs import (
    ImposedLink,
    RigSource,
    RoadMotion,
    cam_excitation,
    cam_road,
    flat_road,
    held_link,
    nominal_test,
    sweep_road,
)
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    harmonics,
    resolve,
    simulate_periodic,
)
from savgs_ident.simulate.program_cache import placed
from savgs_ident.simulate.public import DWELLS
from savgs_ident.simulate.transient import (
    pack_state,
    rest_state,
    simulate_transient,
    through_sensors,
    unpack_state,
)
from savgs_ident.validation.fixed_step import integrate_fixed
from savgs_ident.validation.sensor_chain import Sensors


@dataclass(frozen=True)
class Programme:
    """The tests of a campaign.

    Attributes:
        dwells: frequencies [Hz], increasing.
        periods: a dwell holds at least so many whole periods,
        least: and lasts at least so long [s].
        standstill: length of the standstill [s].
        sweep: length of the sweep from 0 to ``sweep_end`` Hz [s]; 0 for none.
        sweep_end: its last frequency [Hz].
    """

    dwells: tuple[float, ...] = DWELLS
    periods: int = 8
    least: float = 6.0
    standstill: float = 10.0
    sweep: float = 0.0
    sweep_end: float = 3.0

    def periods_at(self, frequency: float) -> int:
        """Whole periods of a dwell [Hz]."""
        return max(self.periods, ceil(self.least * frequency - 1e-9))


ORDERS = 9
"""Highest order of the harmonics in which changes are measured."""

ITERATIONS = 40
"""Most Newton steps from a motion that is known to one near it."""


@dataclass(frozen=True)
class Bench:
    """The rig as known beforehand, and what it is put through.

    Attributes:
        rig: the rig's sheet.
        baseline: effects that the model of the diagnosis has.
        free: parameters that the diagnosis identifies in any case.
        programme: the tests.
        sensors: what the sensors add.
        settings: how finely periodic motions are solved.
        catalogue: the effects that it may have, by name, those of the baseline among them.
        drift: by how much parameters change from the first test to the last, relative, about their mean; by name.
        step: of a fixed-step integration of what is recorded [s]; 0 for one that controls its error.
    """

    rig: Rig
    baseline: tuple[str, ...]
    free: tuple[str, ...]
    programme: Programme = field(default_factory=Programme)
    sensors: Sensors = field(default_factory=Sensors)
    settings: PeriodicSettings = field(default_factory=PeriodicSettings)
    catalogue: Mapping[str, Effect] = field(default_factory=lambda: CATALOGUE)
    drift: Mapping[str, float] = field(default_factory=dict)
    step: float = 0.0

    @cached_property
    def table(self) -> ParameterTable:
        """All parameters of rig and catalogue, effects that the baseline does not have at their null."""
        brought = (ParameterTable(effect.parameters) for effect in self.catalogue.values())
        table = merge_parameters(self.rig.parameters, *brought)
        absent = [each for name, each in self.catalogue.items() if name not in self.baseline]
        return table.with_values({name: null for each in absent for name, null in each.null.items()})

    @cached_property
    def unknown(self) -> tuple[str, ...]:
        """Parameters of which nothing is known beforehand: identified, and without a tolerance."""
        return tuple(name for name in self.free if self.table[name].tolerance == 0.0)

    @cached_property
    def excitation(self) -> Excitation:
        """The cam in all dwells, and a rigid link."""
        lift, angle = nominal_test(self.table.as_dict())
        return cam_excitation(self.programme.dwells, lift, angle)

    def model(self, effects: Sequence[str]) -> QuarterCar:
        """The baseline with ``effects``, and with all that have no states."""
        known = self.catalogue
        plain = [name for name, each in known.items() if name in self.baseline or not each.states]
        added = [name for name in known if name in effects and name not in plain]
        model = QuarterCar(damper_curve(self.rig))
        for name in (*plain, *added):
            model = model + known[name]
        return model

    def values(self, given: Mapping[str, float]) -> Values:
        """All parameters, SI, with the given ones."""
        values: Values = placed(as_values(self.table.as_dict() | dict(given)))
        return values

    def values_during(self, given: Mapping[str, float]) -> tuple[Values, ...]:
        """All parameters, SI, in each dwell of the programme, drift included; the last are those of the sweep."""
        count = len(self.programme.dwells)
        if not self.drift:
            return (self.values(given),) * count
        shares = np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)
        before = self.table.as_dict() | dict(given)
        return tuple(
            self.values({**given, **{n: before[n] * (1.0 + d * share) for n, d in self.drift.items()}})
            for share in shares.tolist()
        )

    def solve(
        self, effects: Sequence[str], given: Mapping[str, float], near: PeriodicSolution | None = None
    ) -> PeriodicSolution | None:
        """Periodic motions in all dwells, from motions of the same effects nearby if there are any.

        None if a dwell has none. ``given`` are parameters in SI.
        """
        model, p = self.model(effects), self.values(given)
        if near is not None:
            solution = resolve(model, p, near, ITERATIONS)
            if all(status.ok for status in solution.status()):
                return solution
        solution = simulate_periodic(model, p, self.excitation, self.settings)
        return solution if all(status.ok for status in solution.status()) else None

    def response(
        self, effects: Sequence[str], given: Mapping[str, float], solution: PeriodicSolution
    ) -> NDArray[np.complex128]:
        """Harmonics 0..ORDERS [unit of the reading] of both response channels, (D, 2, ORDERS + 1)."""
        return np.asarray(harmonics(self.model(effects), self.values(given), solution, ORDERS))


def change_of(there: NDArray[np.complex128], without: NDArray[np.complex128]) -> float:
    """By how much a response differs from the one without an effect, relative; (D, 2, K) each.

    The largest over dwells and channels of two: the complex change of the first harmonic over it, and the rms
    change of the waveform over its rms.
    """
    moved, size = np.abs(there - without)[..., 1:], np.abs(without)[..., 1:]
    first = moved[..., 0] / size[..., 0]
    waveform = np.linalg.norm(moved, axis=-1) / np.linalg.norm(size, axis=-1)
    return float(np.max(np.maximum(first, waveform)))


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
        model.damper,
        effects=tuple(each for each in model.effects if not isinstance(each.law, AbstractSensorLaw)),
    )


def steady_dwells(
    model: QuarterCar, during: Sequence[Values], frequencies: tuple[float, ...], step: float = 0.0
) -> Iterator[Steady]:
    """The steady motions of the rig in one dwell after the other [Hz], with a link held at its nominal angle.

    ``during`` are the parameters [SI] in each; ``step`` [s] is that of a fixed-step integration, 0 for one that
    controls its error.
    """
    mechanics = without_sensor_faults(model)
    _, angle = nominal_test(during[0])
    state, rise = _at_rest(mechanics, during[0], placed(held_link(angle))), STRETCH
    for frequency, p in zip(frequencies, during, strict=True):
        apart = np.inf
        for _ in range(ceil(PATIENCE / STRETCH)):
            periods = ceil(STRETCH * frequency)
            before, state = state, _stretch(mechanics, p, state, frequency, periods, rise, step)[0]
            apart, rise = _apart(mechanics, before, state), 0.0
            if apart < CLOSED or np.isnan(apart):
                break
        state, truth = _stretch(mechanics, p, state, frequency, 1, rise, step)
        yield Steady(frequency, _shown(model, p, frequency, truth), bool(apart < CLOSED))


def _apart(model: QuarterCar, before: Array, after: Array) -> float:
    """Largest difference of two packed states, of their typical sizes; NaN if one is not a number."""
    scale = np.array(state_sizes(model))
    return float(np.max(np.abs(np.asarray(after) - np.asarray(before)) / scale))


def _stretch(
    model: QuarterCar, p: Values, start: Array, frequency: float, periods: int, rise: float, step: float
) -> tuple[Array, NDArray[np.float64]]:
    """The packed state after so many periods, and what was read on the way, (2, SAMPLES).

    The cam's lift grows to its height during the first ``rise`` [s].
    """
    lift, angle = nominal_test(p)
    if step > 0.0:
        source = placed(RigSource(cam_road(lift, frequency, rise), held_link(angle)))
        found = integrate_fixed(model, p, start, source, periods / frequency, SAMPLES, step)
        return found[0], np.asarray(found[1])
    times = np.linspace(0.0, periods / frequency, SAMPLES + 1)
    drive = (cam_road(lift, frequency, rise), held_link(angle), jnp.asarray(times))
    end, readings = _integrated(model, p, start, *placed(drive))
    return end, np.asarray(readings)


@eqx.filter_jit
def _at_rest(model: QuarterCar, p: Values, link: ImposedLink) -> Array:
    return pack_state(rest_state(model, p, RigSource(flat_road(), link), jnp.zeros(())))


# Compiled as a whole: what prepares an integration would take longer than the integration, step by step.
@eqx.filter_jit
def _integrated(
    model: QuarterCar, p: Values, start: Array, road: RoadMotion, link: ImposedLink, times: Array
) -> tuple[Array, Array]:
    found = simulate_transient(model, p, RigSource(road, link), times, unpack_state(model, start), PRECISION)
    return pack_state(found.state_at(-1)), jnp.stack(found.readings)[:, :-1]


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
        shown, ended = _swept_fixed(model, p, RigSource(road, link), times, step), jnp.asarray(True)
    else:
        shown, ended = _swept(model, p, *placed((road, link, jnp.asarray(times))))
    if not np.isfinite(shown).all() or not bool(ended):
        raise InputError("the sweep cannot be simulated", source="sweep", remedy="draw another rig")
    return times, np.asarray(shown)


def _swept_fixed(
    model: QuarterCar, p: Values, source: RigSource, times: NDArray[np.float64], step: float
) -> Array:
    """Readings (2, n) at evenly spaced instants [s]."""
    start, lasts = _at_rest(model, p, placed(source.link)), float(times[-1]) * times.size / (times.size - 1)
    readings = integrate_fixed(model, p, start, placed(source), lasts, times.size, step)[1]
    return through_sensors(partial(model.transfers, p), jnp.asarray(times), readings)


@eqx.filter_jit
def _swept(
    model: QuarterCar, p: Values, road: RoadMotion, link: ImposedLink, times: Array
) -> tuple[Array, Array]:
    found = simulate_transient(model, p, RigSource(road, link), times, tolerance=PRECISION)
    return jnp.stack(found.readings), jnp.asarray(found.result == RESULTS.successful)
