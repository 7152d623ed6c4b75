"""The report on the closed loop: one page."""

from savgs_ident.control.closed_loop.laws import KINDS
from savgs_ident.control.closed_loop.programme import LoopKind
from savgs_ident.control.closed_loop.study import LoopStudy
from savgs_ident.core.presentation import Origin
from savgs_ident.core.values import Values
from savgs_ident.report.control.loop_figures import (
    PAPER,
    causes_figure,
    failures_figure,
    loop_signals_figure,
    rigs_figure,
)
from savgs_ident.report.control.loop_text import (
    alarm,
    drive_rows,
    energy_words,
    failure_words,
    headline,
    ride_rows,
    rigs_words,
    saturation_words,
)
from savgs_ident.report.html import Fact, Section, SectionPage, Table, embed, section_page
from savgs_ident.report.text import MINUS, decimal, percentage


def loop_html(study: LoopStudy, p: Values, origin: Origin, controller: str) -> str:
    """The page: one file, no network, nothing executed; ``controller`` says which one it is."""
    sections = [_ride(study, p), _failures(study)]
    if study.on_rigs:
        sections.append(_rigs(study))
    if study.causes:
        sections.append(_causes(study))
    return section_page(
        SectionPage(
            kind=f"Closed loop on {origin.rig}",
            title=f"Closed loop on {origin.rig}",
            sentence=headline(study),
            intro=(
                "The nonlinear rig with its friction, the drive in d-q axes with its limits, instruments with noise"
                " and steps, and the sampled controller, in one simulation; passive means that the drive holds the"
                " link."
            ),
            alarm=alarm(study),
            facts=_facts(study),
            sections=tuple(sections),
            settings={
                "Rig file": origin.model,
                "Effects": origin.with_effects,
                "Controller": controller,
                "Test": study.test.title,
            },
            command=origin.command_line,
            versions=origin.versions,
        )
    )


def _facts(study: LoopStudy) -> tuple[Fact, ...]:
    gain, drive = study.gain, study.drive
    at_paper = study.test.name is LoopKind.harmonic
    low, high = drive.angle_deg
    return (
        Fact(
            "Acceleration",
            f"{decimal(-gain.sprung_accel, 1)} %",
            f"rms, active against passive{f'; paper {MINUS}{PAPER[0]} % at 2 Hz' if at_paper else ''}",
        ),
        Fact(
            "Deflection",
            f"{decimal(-gain.susp_deflection, 1)} %",
            f"rms{f'; paper {MINUS}{PAPER[1]} % at 2 Hz' if at_paper else ''}",
        ),
        Fact("Tyre load", f"{decimal(-gain.tyre_load, 1)} %", "rms about its mean"),
        Fact(
            "Motor", f"{decimal(drive.speed_peak_rpm, 0)} 1/min", f"saturated {percentage(drive.saturated)}"
        ),
        Fact("Link", f"{decimal(low, 0)} to {decimal(high, 0)}°", "of 0 to 180°"),
        Fact(
            "Stable",
            "yes" if study.stable else "no",
            f"here and on {len(study.on_rigs)} other rigs" if study.on_rigs else "here",
            bad=not study.stable,
        ),
    )


def _ride(study: LoopStudy, p: Values) -> Section:
    words = f"Signals over time, passive and active. {headline(study)} {saturation_words(study)}"
    rows = (*ride_rows(study), *((name, "", value, "") for name, value in drive_rows(study)))
    return Section(
        "ride",
        "The ride and what the drive does for it",
        note=f"{saturation_words(study)} {energy_words(study.drive)}",
        picture=embed(loop_signals_figure(study, p), words),
        caption="Dashed: passive. Dotted: limits of the drive.",
        wide=True,
        table=Table("Passive and active", ("", "Passive", "Active", "Fell by [%]"), rows, (1, 2, 3)),
    )


def _failures(study: LoopStudy) -> Section:
    rows = tuple(
        (
            KINDS[failed.kind].about,
            decimal(failed.ride.sprung_accel, 3),
            decimal(1e3 * failed.ride.susp_deflection, 2),
            "yes" if failed.ride.stable else "no",
        )
        for failed in study.failures
    )
    passive, active = (
        (
            name,
            decimal(ride.sprung_accel, 3),
            decimal(1e3 * ride.susp_deflection, 2),
            "yes" if ride.stable else "no",
        )
        for name, ride in (("nothing; passive", study.passive_after), ("nothing; active", study.active_after))
    )
    return Section(
        "failures",
        "When something fails",
        note=" ".join(failure_words(study, failed) for failed in study.failures),
        picture=embed(
            failures_figure(study), "Acceleration and link angle before and after each failure, over time."
        ),
        caption="The dotted line marks the failure.",
        wide=True,
        table=Table(
            "From the failure on",
            ("Failure", "Rms acceleration [m/s²]", "Rms deflection [mm]", "Comes to rest"),
            (passive, active, *rows),
            (1, 2),
        ),
    )


def _rigs(study: LoopStudy) -> Section:
    return Section(
        "rigs",
        "On other rigs that the data allow",
        note=rigs_words(study),
        picture=embed(rigs_figure(study), rigs_words(study)),
        caption="Each point is one rig, with the same controller.",
        wide=True,
    )


def _causes(study: LoopStudy) -> Section:
    rows = tuple(
        (
            each.variant,
            decimal(each.gain.sprung_accel, 1),
            decimal(each.gain.susp_deflection, 1),
            decimal(each.gain.tyre_load, 1),
        )
        for each in study.causes
    )
    return Section(
        "causes",
        "Why",
        note="The same controller and test, with one imperfection taken away at a time, passive and active.",
        picture=embed(
            causes_figure(study), "Bars: by how much acceleration and deflection fall in each variant."
        ),
        caption="What a bar gains over the first row is what that imperfection costs.",
        wide=True,
        table=Table(
            "Fall of the rms [%]", ("Variant", "Acceleration", "Deflection", "Tyre load"), rows, (1, 2, 3)
        ),
    )
