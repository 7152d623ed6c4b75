"""A study of the closed loop in words, as tables in the terminal, and as the JSON object of ``closed-loop.json``."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Group, RenderableType

from savgs_ident.control.closed_loop.laws import KINDS
from savgs_ident.control.closed_loop.programme import DriveUse, Ride, RideGain
from savgs_ident.control.closed_loop.study import FailedRun, LoopStudy
from savgs_ident.core.presentation import Origin
from savgs_ident.report.text import decimal, percentage, plain, table


def fell_words(percent: float) -> str:
    """A reduction in per cent in words: by how much something fell, or rose."""
    return f"{'less' if percent >= 0.0 else 'more'} by {decimal(abs(percent), 1)} %"


def headline(study: LoopStudy) -> str:
    """What the loop does, in one sentence."""
    if not study.active_ride.stable:
        return f"The loop is not stable: {study.test.title}."
    if not study.passive_ride.stable:
        return f"The passive rig does not come to rest: {study.test.title}."
    gain = study.gain
    return (
        f"The body accelerates {fell_words(gain.sprung_accel)} and the suspension deflects"
        f" {fell_words(gain.susp_deflection)}: {study.test.title}."
    )


def alarm(study: LoopStudy) -> str:
    """Why the loop is not to be used; empty if nothing was found."""
    for ride, run, what in (
        (study.passive_ride, study.passive, "The passive rig"),
        (study.active_ride, study.active, "The loop"),
    ):
        if not run.status.ok:
            return f"{what} leaves the travel of its linkage, or its motion grows without bound."
        if not ride.stable:
            return f"{what} is not stable on this rig: its motion does not end with the road's."
    if study.doubted_from is not None:
        return (
            f"From {decimal(study.doubted_from, 1)} s on the control law rejected the link angle, which moved further"
            " in a sample than the motor can turn it: the link was held from then on."
        )
    bad = sum(not each.stable for each in study.on_rigs)
    return f"The loop is not stable on {bad} of {len(study.on_rigs)} rigs that the data allow." if bad else ""


def saturation_words(study: LoopStudy) -> str:
    """Whether and when more speed was asked for than the drive gives."""
    drive = study.drive
    if not study.active.status.ok:
        return "What the drive did is not known: the run did not end well."
    if drive.saturated_from is None:
        return "The drive was never asked for more speed than it gives."
    sentence = (
        f"The drive was asked for more speed than it gives in {percentage(drive.saturated)} of the time, first at"
        f" {_moment(study, drive.saturated_from)}"
    )
    if drive.limited_from is None:
        return f"{sentence}; it never ran at its limit."
    return f"{sentence}; it ran at its limit from {_moment(study, drive.limited_from)} on."


def _moment(study: LoopStudy, time: float) -> str:
    """A time of a test in words: of a sweep, the frequency that it reached."""
    if study.test.sweeps is None:
        return f"{decimal(time, 1)} s"
    low, high = study.test.sweeps
    return f"{decimal(low + (high - low) * time / study.test.end, 2)} Hz"


def energy_words(drive: DriveUse) -> str:
    """What the drive took and gave back."""
    return (
        f"Electric energy: {decimal(drive.energy, 0)} J net; {decimal(drive.returned, 0)} J were given back on the"
        " way."
    )


def failure_words(study: LoopStudy, failed: FailedRun) -> str:
    """What a failure led to."""
    about = KINDS[failed.kind].about
    if not failed.run.status.ok or not failed.ride.stable:
        return f"When {about}, the motion does not end with the road's."
    final = np.degrees(float(np.asarray(failed.run.signals.link_angle)[-1]))
    rose = failed.ride.sprung_accel / study.passive_after.sprung_accel - 1.0
    return (
        f"When {about}, the body accelerates {fell_words(-100.0 * rose)} than passively from then on; the link"
        f" ends at {decimal(final, 0)} deg."
    )


def rigs_words(study: LoopStudy) -> str:
    """How the loop does on other rigs that the data allow; that it was not tried, if so."""
    if study.rigs is None or not study.on_rigs:
        return "The loop was tried on no other rig."
    stable = sum(each.stable for each in study.on_rigs)
    stability = f"Stable on {stable} of {len(study.on_rigs)} ({study.rigs.source})"
    ended = [each.gain for each in study.on_rigs if each.status.ok]
    if not ended:
        return f"{stability}."
    accel = [gain.sprung_accel for gain in ended]
    deflection = [gain.susp_deflection for gain in ended]
    return (
        f"{stability}; the acceleration falls by"
        f" {decimal(min(accel), 1)} to {decimal(max(accel), 1)} %, the deflection by {decimal(min(deflection), 1)} to"
        f" {decimal(max(deflection), 1)} %."
    )


RideRow = tuple[str, str, str, str]


def ride_rows(study: LoopStudy) -> tuple[RideRow, ...]:
    """Quantity with unit, passive, active, and by how much it fell [%]."""
    before, after, gain = study.passive_ride, study.active_ride, study.gain
    parts = (
        ("rms acceleration [m/s²]", "sprung_accel", 1.0, 3),
        ("rms deflection [mm]", "susp_deflection", 1e3, 3),
        ("rms tyre load about its mean [N]", "tyre_load", 1.0, 1),
    )
    return tuple(
        (
            name,
            decimal(scale * getattr(before, field), places),
            decimal(scale * getattr(after, field), places),
            decimal(getattr(gain, field), 2),
        )
        for name, field, scale, places in parts
    )


def drive_rows(study: LoopStudy) -> tuple[tuple[str, str], ...]:
    """What the drive did, by name with unit."""
    drive = study.drive
    low, high = drive.angle_deg
    return (
        ("peak motor speed [1/min]", decimal(drive.speed_peak_rpm, 0)),
        ("time with more speed asked for than there is [%]", decimal(100.0 * drive.saturated, 2)),
        ("link angle [deg]", f"{decimal(low, 1)} to {decimal(high, 1)}"),
        ("peak power at the motor's shaft [W]", decimal(drive.power_peak, 0)),
        ("electric energy, net [J]", decimal(drive.energy, 0)),
    )


def loop_text(study: LoopStudy) -> RenderableType:
    """Everything of a study in tables and sentences."""
    parts: list[RenderableType] = [
        plain(headline(study), "bold"),
        plain(""),
        table("Ride", ("", "passive", "active", "fell by\n[%]"), ride_rows(study)),
        table("Drive", ("", ""), drive_rows(study)),
        plain(f"{saturation_words(study)} {energy_words(study.drive)}"),
        plain(rigs_words(study)),
        plain(""),
        plain("When something fails", "bold"),
        *(plain(failure_words(study, failed)) for failed in study.failures),
        plain(""),
    ]
    if study.causes:
        rows = [
            (each.variant, decimal(each.gain.sprung_accel, 1), decimal(each.gain.susp_deflection, 1))
            for each in study.causes
        ]
        headers = ("", "acceleration\nfell by [%]", "deflection\nfell by [%]")
        parts.append(table("Why: one imperfection taken away at a time", headers, rows))
    return Group(*parts)


SIGNAL_UNITS = {
    "time": "s",
    "road": "m",
    "sprung_accel": "m/s^2",
    "susp_deflection": "m",
    "tyre_load": "N",
    "wishbone_angle": "rad",
    "link_angle": "rad",
    "link_velocity": "rad/s",
    "asked": "rad/s",
    "motor_torque": "N m",
    "shaft_power": "W",
    "electric_power": "W",
    "doubted": "1",
}
"""Units of the signals of a run."""


def loop_record(study: LoopStudy, origin: Origin, controller: str) -> dict[str, Any]:
    """What the loop does in a test, with failures, on other rigs, and why; ``controller`` says which one it is."""
    drive = study.drive
    return {
        "schema": 1,
        "rig": origin.rig,
        "effects": list(origin.effects),
        "controller": controller,
        "test": {
            "name": study.test.name.value,
            "title": study.test.title,
            "judged_from_s": study.test.start,
            "judged_to_s": study.test.end,
        },
        "rms_reduction_percent": {
            "sprung_accel": study.gain.sprung_accel,
            "susp_deflection": study.gain.susp_deflection,
        },
        "tyre_load_rms_change_percent": -study.gain.tyre_load,
        "motor_speed_peak_rpm": drive.speed_peak_rpm,
        "saturated_fraction": drive.saturated,
        "saturated_from_s": drive.saturated_from,
        "saturated_from_hz": _reached(study, drive.saturated_from),
        "speed_limit_from_s": drive.limited_from,
        "speed_limit_from_hz": _reached(study, drive.limited_from),
        "link_angle_range_deg": list(drive.angle_deg),
        "peak_power_w": drive.power_peak,
        "energy_j": drive.energy,
        "energy_returned_j": drive.returned,
        "stable": study.stable,
        "angle_doubted_from_s": study.doubted_from,
        "trusted": study.trusted,
        "passive": _ride(study.passive_ride),
        "active": _ride(study.active_ride),
        "failures": {
            failed.kind: {
                "about": KINDS[failed.kind].about,
                "at_s": study.test.fails_at,
                "from_then_on": _ride(failed.ride),
                "passive_then": _ride(study.passive_after),
                "final_link_angle_deg": float(np.degrees(failed.run.signals.link_angle[-1])),
            }
            for failed in study.failures
        },
        "rigs": None
        if study.rigs is None
        else {
            "source": study.rigs.source,
            "count": len(study.on_rigs),
            "stable": sum(each.stable for each in study.on_rigs),
            "rms_reduction_percent": [_gain(each.gain) for each in study.on_rigs],
        },
        "causes": [{"variant": each.variant} | _gain(each.gain) for each in study.causes],
        "model": origin.model,
        "command": origin.command_line,
        "versions": dict(origin.versions),
    }


def _reached(study: LoopStudy, time: float | None) -> float | None:
    """Frequency of a sweep [Hz] at a time [s]; None where there is none."""
    if study.test.sweeps is None or time is None:
        return None
    low, high = study.test.sweeps
    return low + (high - low) * time / study.test.end


def _ride(ride: Ride) -> dict[str, Any]:
    return {
        "sprung_accel_rms_m_per_s2": ride.sprung_accel,
        "susp_deflection_rms_m": ride.susp_deflection,
        "tyre_load_rms_n": ride.tyre_load,
        "no_contact_fraction": ride.lifts,
        "stable": ride.stable,
    }


def _gain(gain: RideGain) -> dict[str, float]:
    return {
        "sprung_accel": gain.sprung_accel,
        "susp_deflection": gain.susp_deflection,
        "tyre_load": gain.tyre_load,
    }


def loop_columns(study: LoopStudy) -> dict[str, Sequence[object]]:
    """The signals of the active run and, prefixed ``passive_``, the response of the passive one, with units."""
    active = {name: getattr(study.active.signals, name) for name in SIGNAL_UNITS}
    response = ("sprung_accel", "susp_deflection", "tyre_load")
    passive = {f"passive_{name}": getattr(study.passive.signals, name) for name in response}
    units = SIGNAL_UNITS | {f"passive_{name}": SIGNAL_UNITS[name] for name in response}
    return {
        f"{name} [{units[name]}]": [f"{value:.9g}" for value in np.asarray(values)]
        for name, values in (active | passive).items()
    }
