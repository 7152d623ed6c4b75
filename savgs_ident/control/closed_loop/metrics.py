"""What a run is worth: comfort, road holding, and what the drive had to do for it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.closed_loop.programme import REST, LoopTest
from savgs_ident.control.closed_loop.run import ClosedLoopRun, Signals
from savgs_ident.model.values import Values

LEFT = 0.05
"""Share of the largest deflection of a run that may still move when the road has stood still for a while."""

AT_LIMIT = 0.999
"""From this share of a limit on, the limit counts as reached."""

RUNS_AT = 0.99
"""From this share of its limit on, the motor counts as running at it."""

RPM = 30.0 / np.pi
"""Turns per minute of one rad/s."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ride:
    """How the rig rode during the test: rms about the mean of acceleration [m/s^2], deflection [m], tyre load [N].

    ``lifts`` is the share of time without contact [1]; ``stable`` whether the motion ended with the road.
    """

    sprung_accel: float
    susp_deflection: float
    tyre_load: float
    lifts: float
    stable: bool


@dataclass(frozen=True)
class DriveUse:
    """What the drive did during the test.

    Attributes:
        speed_peak_rpm: of the motor [1/min].
        saturated: share of time in which more speed was asked for than the drive gives [1].
        saturated_from: when that was so first [s]; None if never.
        limited_from: when the motor first ran at its speed limit [s]; None if never.
        angle_deg: least and greatest link angle [deg].
        power_peak: largest power at the motor's shaft [W].
        energy: electric energy taken less what was given back [J].
        returned: electric energy given back [J].
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
    """Whether the deflection stands still at the end, compared with what it was."""
    time, deflection = np.asarray(signals.time), np.asarray(signals.susp_deflection)
    last = deflection[time >= time[-1] - 0.25 * REST]
    return bool(np.ptp(last) <= LEFT * np.ptp(deflection))


def ride_of(run: ClosedLoopRun, test: LoopTest) -> Ride:
    """How the rig rode in a run, all of the time in which the test is judged."""
    return _ride(run, test.start, test.end)


def ride_after(run: ClosedLoopRun, test: LoopTest) -> Ride:
    """How the rig rode from the time on at which something fails, in the runs in which something does."""
    return _ride(run, test.fails_at, test.end)


def _ride(run: ClosedLoopRun, start: float, end: float) -> Ride:
    if not run.status.ok:
        return Ride(np.nan, np.nan, np.nan, np.nan, stable=False)
    signals, judged = run.signals, _between(run.signals, start, end)
    return Ride(
        _rms(np.asarray(signals.sprung_accel)[judged]),
        _rms(np.asarray(signals.susp_deflection)[judged]),
        _rms(np.asarray(signals.tyre_load)[judged]),
        float(np.mean(np.asarray(signals.tyre_load)[judged] <= 0.0)),
        _settles(signals),
    )


def doubted_from(run: ClosedLoopRun) -> float | None:
    """When the law ceased to believe the link angle [s]; None if it never did, or the run did not end well."""
    if not run.status.ok:
        return None
    return _first(np.asarray(run.signals.time), np.asarray(run.signals.doubted) > 0.0)


def _first(time: Array, when: NDArray[np.bool_]) -> float | None:
    return float(time[when][0]) if when.any() else None


def drive_use(run: ClosedLoopRun, test: LoopTest, p: Values) -> DriveUse:
    """What the drive did in a run; nothing is known of one that did not end well."""
    if not run.status.ok:
        return DriveUse(np.nan, np.nan, None, None, (np.nan, np.nan), np.nan, np.nan, np.nan)
    signals, judged = run.signals, _between(run.signals, test.start, test.end)
    ratio, limit = float(p["motor_gear_ratio"]), float(p["motor_speed_limit"])
    time = np.asarray(signals.time)[judged]
    speed = ratio * np.asarray(signals.link_velocity)[judged]
    beyond = ratio * np.abs(np.asarray(signals.asked)[judged]) >= AT_LIMIT * limit
    angle = np.degrees(np.asarray(signals.link_angle)[judged])
    electric = np.asarray(signals.electric_power)[judged]
    step = float(time[1] - time[0])
    return DriveUse(
        float(np.max(np.abs(speed))) * RPM,
        float(np.mean(beyond)),
        _first(time, beyond),
        _first(time, np.abs(speed) >= RUNS_AT * limit),
        (float(np.min(angle)), float(np.max(angle))),
        float(np.max(np.asarray(signals.shaft_power)[judged])),
        float(np.sum(electric)) * step,
        float(-np.sum(np.minimum(electric, 0.0))) * step,
    )


@dataclass(frozen=True)
class Gain:
    """The active rig against the passive one, in per cent: positive is less motion."""

    sprung_accel: float
    susp_deflection: float
    tyre_load: float


def gain_of(passive: Ride, active: Ride) -> Gain:
    """By how much the rms values fell [%]: nothing on a rig that did not move, NaN where a run did not end well."""

    def fell(before: float, after: float) -> float:
        return 0.0 if before == 0.0 else 100.0 * (1.0 - after / before)

    return Gain(
        fell(passive.sprung_accel, active.sprung_accel),
        fell(passive.susp_deflection, active.susp_deflection),
        fell(passive.tyre_load, active.tyre_load),
    )
