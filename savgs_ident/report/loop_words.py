"""What a study of the closed loop says in words."""

import numpy as np

from savgs_ident.control.closed_loop.failure import KINDS
from savgs_ident.control.closed_loop.metrics import DriveUse
from savgs_ident.control.closed_loop.study import Failed, LoopStudy
from savgs_ident.report.numerals import decimal, percentage


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
            f"From {decimal(study.doubted_from, 1)} s on the law did not believe the link angle, which moved further"
            " in a sample than the motor can turn it: the link stood still from then on."
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
    told = (
        f"The drive was asked for more speed than it gives in {percentage(drive.saturated)} of the time, first at"
        f" {_moment(study, drive.saturated_from)}"
    )
    if drive.limited_from is None:
        return f"{told}; it never ran at its limit."
    return f"{told}; it ran at its limit from {_moment(study, drive.limited_from)} on."


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


def failure_words(study: LoopStudy, failed: Failed) -> str:
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
    told = f"Stable on {stable} of {len(study.on_rigs)} ({study.rigs.source})"
    ended = [each.gain for each in study.on_rigs if np.isfinite(each.gain.sprung_accel)]
    if not ended:
        return f"{told}."
    accel = [gain.sprung_accel for gain in ended]
    deflection = [gain.susp_deflection for gain in ended]
    return (
        f"{told}; the acceleration falls by"
        f" {decimal(min(accel), 1)} to {decimal(max(accel), 1)} %, the deflection by {decimal(min(deflection), 1)} to"
        f" {decimal(max(deflection), 1)} %."
    )
