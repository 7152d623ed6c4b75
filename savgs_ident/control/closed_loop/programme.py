"""The tests of a closed loop: what the road does, for how long, and over which time it is evaluated.

Every test ends with a road at standstill, so that a motion which does not decay is seen. Roads are the cam (harmonic,
sweep), a speed bump, and random roads after ISO 8608: a road of class A to H has the displacement spectrum

    G_d(n) = G_d(n_0) (n / n_0)^-2,     n_0 = 0.1 cycles/m,

between 0.011 and 2.83 cycles/m. A wheel at speed v meets it as a sum of sines with random phases; the contact patch
filters out anything faster.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import ceil
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from savgs_ident.plants.profiles import Faded, LinearSweep, Sine, tabulated
from savgs_ident.plants.quarter_car.inputs import RoadMotion

ROUGHNESS: Mapping[str, float] = MappingProxyType({"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6})
"""Geometric mean of G_d(n_0) of the classes [m^3], ISO 8608 table C.1."""
REFERENCE = 0.1
"""n_0 [cycles/m]."""
BAND = (0.011, 2.83)
"""Spatial frequencies of a road [cycles/m]."""
STEP = 1e-3
"""Time between the points of a road [s]."""
SEED = 8608
"""Seed of the phases: the same road every time."""
REST = 2.0
"""Duration of the standstill at the end [s]."""
FADE = 0.5
"""Duration of the fade of a road at its beginning and end [s]."""
SETTLE = 4.0
"""Time that is not evaluated at the beginning of a harmonic test [s]."""
SWEEP = (0.0, 3.0, 60.0)
"""First and last frequency [Hz] and duration [s] of the sweep of Fig. 11."""
BUMP = (0.05, 2.0, 5.0)
"""Height and length [m] of the bump, and the least duration of its test [s]."""
BEYOND = 2.0
"""Least duration of the test after the bump [s]."""


GRID = 0.02
"""A harmonic test ends on a multiple of this [s], a whole number of frames of the loop."""


class LoopKind(StrEnum):
    """The kinds of tests."""

    harmonic = "harmonic"
    sweep = "sweep"
    iso = "iso"
    bump = "bump"


DEFAULT_SPEED: Mapping[LoopKind, float] = MappingProxyType({LoopKind.iso: 20.0, LoopKind.bump: 20.0 / 3.6})
"""Speeds of driving [m/s] of the tests that have one."""


@dataclass(frozen=True)
class LoopTest:
    """A test of the closed loop.

    Attributes:
        name: its kind.
        title: its description.
        road: motion of the plate.
        start, end: the time that is evaluated [s].
        fails_at: instant of the failure, in runs with a failure [s].
        sweeps: frequencies at time 0 and at ``end`` [Hz]; None unless it is a sweep.
    """

    name: LoopKind
    title: str
    road: RoadMotion
    start: float
    end: float
    fails_at: float
    sweeps: tuple[float, float] | None = None

    @property
    def duration(self) -> float:
        """The whole duration [s], with the fade of the road and the standstill."""
        return self.end + FADE + REST


def harmonic_test(peak_to_peak: float, frequency: float, duration: float = 12.0) -> LoopTest:
    """A steady cam of height ``peak_to_peak`` [m] at ``frequency`` [Hz] (Fig. 10), evaluated over whole periods."""
    periods = max(1, int((duration - SETTLE) * frequency))
    end = SETTLE + periods / frequency
    end = round(end / GRID) * GRID
    road = RoadMotion(Faded(Sine(peak_to_peak / 2.0, frequency, 0.0, 0.0, 2.0), end, FADE))
    title = f"cam of {1e3 * peak_to_peak:g} mm peak to peak at {frequency:g} Hz"
    return LoopTest(LoopKind.harmonic, title, road, SETTLE, end, 0.5 * (SETTLE + end))


def sweep_test(peak_to_peak: float) -> LoopTest:
    """The sweep of Fig. 11: 0 to 3 Hz in 60 s, ``peak_to_peak`` in [m]."""
    low, high, duration = SWEEP
    road = RoadMotion(Faded(LinearSweep(peak_to_peak / 2.0, low, high, duration), duration, FADE))
    title = f"sweep of {1e3 * peak_to_peak:g} mm peak to peak, {low:g} to {high:g} Hz in {duration:g} s"
    return LoopTest(LoopKind.sweep, title, road, 0.0, duration, 0.6 * duration, (low, high))


def iso_test(grade: str, speed: float, duration: float = 20.0) -> LoopTest:
    """A random road of an ISO class A to D at ``speed`` [m/s]."""
    road = iso_road(grade, speed, duration, FADE)
    title = f"random road of ISO 8608 class {grade} at {3.6 * speed:g} km/h"
    return LoopTest(LoopKind.iso, title, road, 1.0, duration, 0.4 * duration)


def bump_test(speed: float) -> LoopTest:
    """A speed bump at ``speed`` [m/s]."""
    height, length, shortest = BUMP
    begins = 0.5
    duration = max(shortest, ceil(begins + length / speed + BEYOND))
    road = bump_road(height, length, speed, begins)
    title = f"speed bump, {1e3 * height:g} mm high and {length:g} m long, at {3.6 * speed:g} km/h"
    return LoopTest(LoopKind.bump, title, road, 0.0, duration, begins + 0.5 * length / speed)


def iso_height(grade: str, speed: float, duration: float) -> NDArray[np.float64]:
    """Heights [m] every :data:`STEP` of a road of class ``grade`` met at ``speed`` [m/s] for ``duration`` [s].

    A class that is not in :data:`ROUGHNESS` is a KeyError. Heights are (n,).
    """
    count = round(duration / STEP) + 1
    n = np.fft.rfftfreq(count, STEP) / speed
    inside = (n >= BAND[0]) & (n <= BAND[1])
    amplitude = np.zeros(n.size)
    amplitude[inside] = np.sqrt(2.0 * ROUGHNESS[grade] * (n[inside] / REFERENCE) ** -2 * n[1])
    phase = np.random.default_rng(SEED).uniform(0.0, 2.0 * np.pi, n.size)
    return np.fft.irfft(0.5 * amplitude * np.exp(1j * phase) * count, count)


def iso_road(grade: str, speed: float, duration: float, fade: float) -> RoadMotion:
    """The road of :func:`iso_height` as a motion of the plate that fades in and out within ``fade`` [s]."""
    height = iso_height(grade, speed, duration + fade)
    time = STEP * np.arange(height.size)
    return RoadMotion(Faded(tabulated(time, height, f"ISO 8608 {grade}"), duration, fade))


def bump_road(height: float, length: float, speed: float, start: float) -> RoadMotion:
    """A bump of ``height`` and ``length`` [m], one wave of a cosine, met at ``start`` [s] with ``speed`` [m/s]."""
    passing = length / speed
    share = np.linspace(0.0, 1.0, 201)
    table = 0.5 * height * (1.0 - np.cos(2.0 * np.pi * share))
    return RoadMotion(tabulated(start + passing * share, table, "speed bump"))
