"""The tests of a closed loop and their evaluation: what the road does, for how long, and what is measured of a run.

Roads are the cam (harmonic, sweep), a speed bump, and random roads after ISO 8608. A road of class A to H has the
displacement spectrum

    G_d(n) = G_d(n_0) (n / n_0)^-2,     n_0 = 0.1 cycles/m,

between 0.011 and 2.83 cycles/m. A wheel at speed v meets it as a sum of sines with random phases; the contact patch
filters out anything faster.

Every test ends with a road at standstill, so that a motion which does not decay is seen. A run is evaluated over the
time that its test names: comfort, road holding (:class:`Ride`), and the use of the drive (:class:`DriveUse`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import ceil
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.closed_loop.run import ClosedLoopRun, Signals
from savgs_ident.core.values import Values
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
UNEVALUATED = 4.0
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
    periods = max(1, int((duration - UNEVALUATED) * frequency))
    end = UNEVALUATED + periods / frequency
    end = round(end / GRID) * GRID
    road = RoadMotion(Faded(Sine(peak_to_peak / 2.0, frequency, 0.0, 0.0, 2.0), end, FADE))
    title = f"cam of {1e3 * peak_to_peak:g} mm peak to peak at {frequency:g} Hz"
    return LoopTest(LoopKind.harmonic, title, road, UNEVALUATED, end, 0.5 * (UNEVALUATED + end))


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


LEFT = 0.05
"""Share of the largest deflection of a run that may remain after a while at standstill."""

AT_LIMIT = 0.999
"""Share of a limit from which it counts as reached."""

RUNS_AT = 0.99
"""Share of its speed limit from which the motor counts as running at it."""

RPM = 30.0 / np.pi
"""Turns per minute of one rad/s."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ride:
    """The ride during a test: rms about the mean of acceleration [m/s^2], deflection [m], tyre load [N].

    ``lifts`` is the share of time without contact [1]; ``stable`` whether the motion decayed with the road.
    """

    sprung_accel: float
    susp_deflection: float
    tyre_load: float
    lifts: float
    stable: bool


@dataclass(frozen=True)
class DriveUse:
    """The use of the drive during the test.

    Attributes:
        speed_peak_rpm: of the motor [1/min].
        saturated: share of time in which the commanded speed exceeded the limit of the drive [1].
        saturated_from: the first such time [s]; None if never.
        limited_from: when the motor first ran at its speed limit [s]; None if never.
        angle_deg: least and greatest link angle [deg].
        power_peak: largest power at the motor's shaft [W].
        energy: net electric energy [J].
        returned: regenerated electric energy [J].
    """

    speed_peak_rpm: float
    saturated: float
    saturated_from: float | None
    limited_from: float | None
    angle_deg: tuple[float, float]
    power_peak: float
    energy: float
    returned: float


def _between(signals: Signals, start: float, end: float) -> NDArray[np.bool_]:
    time = np.asarray(signals.time)
    return (time >= start) & (time < end)


def _rms(values: Array) -> float:
    return float(np.std(values))


def _is_at_rest(signals: Signals) -> bool:
    """Whether the deflection at the end is small compared with its range."""
    time, deflection = np.asarray(signals.time), np.asarray(signals.susp_deflection)
    last = deflection[time >= time[-1] - 0.25 * REST]
    return bool(np.ptp(last) <= LEFT * np.ptp(deflection))


def measure_ride(run: ClosedLoopRun, test: LoopTest) -> Ride:
    """The ride of a run over the evaluated time of the test."""
    return _ride(run, test.start, test.end)


def ride_after(run: ClosedLoopRun, test: LoopTest) -> Ride:
    """The ride from the instant of the failure on (also for runs without one)."""
    return _ride(run, test.fails_at, test.end)


def _ride(run: ClosedLoopRun, start: float, end: float) -> Ride:
    if not run.status.ok:
        return Ride(np.nan, np.nan, np.nan, np.nan, stable=False)
    signals, evaluated = run.signals, _between(run.signals, start, end)
    return Ride(
        _rms(np.asarray(signals.sprung_accel)[evaluated]),
        _rms(np.asarray(signals.susp_deflection)[evaluated]),
        _rms(np.asarray(signals.tyre_load)[evaluated]),
        float(np.mean(np.asarray(signals.tyre_load)[evaluated] <= 0.0)),
        _is_at_rest(signals),
    )


def doubted_from(run: ClosedLoopRun) -> float | None:
    """When the law rejected the link angle [s]; None if it never did, or the run failed."""
    if not run.status.ok:
        return None
    return _first(np.asarray(run.signals.time), np.asarray(run.signals.doubted) > 0.0)


def _first(time: Array, when: NDArray[np.bool_]) -> float | None:
    return float(time[when][0]) if when.any() else None


def drive_use(run: ClosedLoopRun, test: LoopTest, p: Values) -> DriveUse:
    """The use of the drive in a run; NaN and None for a run that failed."""
    if not run.status.ok:
        return DriveUse(np.nan, np.nan, None, None, (np.nan, np.nan), np.nan, np.nan, np.nan)
    signals, evaluated = run.signals, _between(run.signals, test.start, test.end)
    ratio, limit = float(p["motor_gear_ratio"]), float(p["motor_speed_limit"])
    time = np.asarray(signals.time)[evaluated]
    speed = ratio * np.asarray(signals.link_velocity)[evaluated]
    beyond = ratio * np.abs(np.asarray(signals.asked)[evaluated]) >= AT_LIMIT * limit
    angle = np.degrees(np.asarray(signals.link_angle)[evaluated])
    electric = np.asarray(signals.electric_power)[evaluated]
    step = float(time[1] - time[0])
    return DriveUse(
        float(np.max(np.abs(speed))) * RPM,
        float(np.mean(beyond)),
        _first(time, beyond),
        _first(time, np.abs(speed) >= RUNS_AT * limit),
        (float(np.min(angle)), float(np.max(angle))),
        float(np.max(np.asarray(signals.shaft_power)[evaluated])),
        float(np.sum(electric)) * step,
        float(-np.sum(np.minimum(electric, 0.0))) * step,
    )


@dataclass(frozen=True)
class RideGain:
    """Reduction of the rms values by the active suspension [%]; negative is more motion."""

    sprung_accel: float
    susp_deflection: float
    tyre_load: float


def compare_rides(passive: Ride, active: Ride) -> RideGain:
    """Reduction of the rms values [%]: 0 for a rig that did not move, NaN where a run failed."""

    def fell(before: float, after: float) -> float:
        return 0.0 if before == 0.0 else 100.0 * (1.0 - after / before)

    return RideGain(
        fell(passive.sprung_accel, active.sprung_accel),
        fell(passive.susp_deflection, active.susp_deflection),
        fell(passive.tyre_load, active.tyre_load),
    )
