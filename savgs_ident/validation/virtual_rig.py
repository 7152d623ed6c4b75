"""The rig on which trials are drawn: its sensors, its programme of tests, and its model with any effects.

A :class:`Bench` is the rig as known beforehand with what it is put through. Effects without states are in every
model, those that were not drawn at their null, so that one compiled program serves nearly all trials; an effect with
states of its own asks for another.

:class:`Sensors` are what is between the truth and what a logger writes: noise, filters, converters, and instants that
jitter. Without colour, corner and bits, the noise is white and nothing else happens to the truth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.forces import damper_curve
from savgs_ident.plants.quarter_car.inputs import (
    cam_excitation,
    nominal_test,
)
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    resolve,
    simulate_periodic,
)
from savgs_ident.simulate.program_cache import placed
from savgs_ident.simulate.public import DWELLS
from savgs_ident.simulate.readings import harmonics

RANGES = (0.05, 50.0, 0.1)
"""Largest road [m], acceleration [m/s^2] and deflection [m] that the logger's converters read."""


@dataclass(frozen=True)
class Sensors:
    """What the sensors add to the truth, as the rig's sheet says.

    Attributes:
        rate: sampling rate [Hz].
        jitter: rms error of the sampling instants [s]; the stamps give the true ones.
        accel: rms noise of the acceleration [m/s^2].
        deflection: of the deflection [m].
        road: of the road's height [m].
        hunting: rms by which a drive that holds the link moves it to and fro [rad].
        counts: of the link's encoder per turn of the link [1].
        colour: correlation of the noise from one sample to the next [1]; 0 for white noise.
        phase: angle by which the road's signal leads the road [rad].
        corner: of the logger's anti-aliasing filters, Butterworth of second order [Hz]; 0 for none.
        bits: of the logger's converters, over the ranges of :data:`RANGES`; 0 for none.
    """

    rate: float = 500.0
    jitter: float = 4e-5
    accel: float = 0.05
    deflection: float = 1e-4
    road: float = 1e-5
    hunting: float = 2.5e-6
    counts: float = 65536.0 * 40.0
    colour: float = 0.0
    phase: float = 0.0
    corner: float = 0.0
    bits: int = 0

    def filtered(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """What the anti-aliasing filters make of frequencies [Hz]."""
        ratio = 1j * frequency / self.corner if self.corner > 0.0 else np.zeros_like(frequency)
        return np.asarray(1.0 / (1.0 + np.sqrt(2.0) * ratio + ratio**2), dtype=np.complex128)

    def noise(self, shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float64]:
        """Noise of unit variance: a row a channel, each of the first order of autoregression with ``colour``."""
        white = random.standard_normal(shape)
        if self.colour == 0.0:
            return white
        drive = np.sqrt(1.0 - self.colour**2)
        coloured: NDArray[np.float64] = lfilter([drive], [1.0, -self.colour], white, axis=-1)
        return coloured

    def converted(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Road, acceleration and deflection, (3, n), as the converters read them."""
        if self.bits == 0:
            return values
        ranges = np.array(RANGES)[:, None]
        count = ranges / 2.0 ** (self.bits - 1)
        return np.clip(count * np.round(values / count), -ranges, ranges - count)


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


OFF = 0.1
"""Relative standard deviation of parameters that are to be identified and have no tolerance."""


def draw_rig(bench: Bench, random: np.random.Generator) -> dict[str, float]:
    """Parameters of the rig [SI] that are not those of the sheet: normal about them, within their bounds."""
    drawn = {}
    for each in bench.rig.parameters.entries:
        spread = each.tolerance or (OFF * abs(each.value) if each.name in bench.free else 0.0)
        if spread == 0.0:
            continue
        value = each.value + spread * random.standard_normal()
        while not each.lower <= value <= each.upper:
            value = each.value + spread * random.standard_normal()
        drawn[each.name] = float(value)
    return drawn


def change_of(there: NDArray[np.complex128], without: NDArray[np.complex128]) -> float:
    """By how much a response differs from the one without an effect, relative; (D, 2, K) each.

    The largest over dwells and channels of two: the complex change of the first harmonic over it, and the rms
    change of the waveform over its rms.
    """
    moved, size = np.abs(there - without)[..., 1:], np.abs(without)[..., 1:]
    first = moved[..., 0] / size[..., 0]
    waveform = np.linalg.norm(moved, axis=-1) / np.linalg.norm(size, axis=-1)
    return float(np.max(np.maximum(first, waveform)))
