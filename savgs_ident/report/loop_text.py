"""A study of the closed loop in the terminal."""

from rich.console import Group, RenderableType

from savgs_ident.control.closed_loop.study import LoopStudy
from savgs_ident.report.loop_words import (
    energy_words,
    failure_words,
    headline,
    rigs_words,
    saturation_words,
)
from savgs_ident.report.numerals import decimal
from savgs_ident.report.terminal import plain, table

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
