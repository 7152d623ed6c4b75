"""The tests of a closed loop: what the road does, for how long, and over which time it is judged.

Every test ends with a road that stands still, so that a motion which does not die out is seen.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import ceil
from types import MappingProxyType

from savgs_ident.control.roads import bump_road, iso_road
from savgs_ident.model.profile import Faded, LinearSweep, Sine
from savgs_ident.model.road import RoadMotion

REST = 2.0
"""How long the road stands still at the end [s]."""

FADE = 0.5
"""How long a road takes to begin and to end [s]."""

SETTLE = 4.0
"""What is left out before a harmonic test is judged [s]."""

SWEEP = (0.0, 3.0, 60.0)
"""First and last frequency [Hz] and duration [s] of the sweep of Fig. 11."""

BUMP = (0.05, 2.0, 5.0)
"""Height and length [m] of the bump, and how long its test lasts at least [s]."""

BEYOND = 2.0
"""How long the test of a bump goes on behind it at least [s]."""


class LoopKind(StrEnum):
    """The tests there are."""

    harmonic = "harmonic"
    sweep = "sweep"
    iso = "iso"
    bump = "bump"


DEFAULT_SPEED: Mapping[LoopKind, float] = MappingProxyType({LoopKind.iso: 20.0, LoopKind.bump: 20.0 / 3.6})
"""Speeds of driving [m/s] of the tests that have one."""


@dataclass(frozen=True)
class LoopTest:
    """A test.

    Attributes:
        name: which.
        title: what it is in words.
        road: what the plate does.
        start, end: when it is judged [s].
        fails_at: when something fails, in the runs in which something does [s].
        sweeps: frequencies at time 0 and at ``end`` of a sweep [Hz]; None of another test.
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
        """All of it [s]: with the end of the road, and rest."""
        return self.end + FADE + REST


def harmonic_test(peak_to_peak: float, frequency: float, duration: float = 12.0) -> LoopTest:
    """A steady cam of height ``peak_to_peak`` [m] at ``frequency`` [Hz] (Fig. 10), judged over whole periods."""
    periods = max(1, int((duration - SETTLE) * frequency))
    end = SETTLE + periods / frequency
    end = round(end / 0.02) * 0.02
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
