"""Evaluation of a run: comfort, road holding, and the use of the drive."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.closed_loop.programme import REST, LoopTest
from savgs_ident.control.closed_loop.run import ClosedLoopRun, Signals
from savgs_ident.core.values import Values

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


def _settles(signals: Signals) -> bool:
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
        _settles(signals),
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
