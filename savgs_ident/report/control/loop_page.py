"""The report on the closed loop: one page, and its figures.

The figures show what moves over time (Figs. 10 and 11 of the paper), what fails, how other rigs do, and why.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from savgs_ident.control.closed_loop.laws import KINDS
from savgs_ident.control.closed_loop.programme import RPM, LoopKind
from savgs_ident.control.closed_loop.run import Signals
from savgs_ident.control.closed_loop.study import LoopStudy
from savgs_ident.core.presentation import Origin
from savgs_ident.core.values import Values
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
from savgs_ident.report.theme import BLUE, GREY, INK, ORANGE, new_figure, printable, styled


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


PASSIVE: Mapping[str, Any] = MappingProxyType({"color": GREY, "linestyle": (0, (4, 1.5)), "linewidth": 1.1})
ACTIVE: Mapping[str, Any] = MappingProxyType({"color": BLUE, "linestyle": "-", "linewidth": 1.3})
LIMIT: Mapping[str, Any] = MappingProxyType({"color": ORANGE, "linestyle": ":", "linewidth": 1.2})

PERIODS = 2.0
"""How much of a harmonic test is shown [s]."""

PAPER = (41.44, 31.11)
"""Reductions of the rms of acceleration and deflection at 2 Hz in the paper's Fig. 10 [%]."""


def loop_signals_figure(study: LoopStudy, p: Values) -> Figure:
    """Acceleration, deflection, tyre load, link angle, motor speed and power over time, passive and active."""
    passive, active = study.passive.signals, study.active.signals
    shown = _shown(study)
    ratio = float(p["motor_gear_ratio"])
    with styled():
        figure = new_figure(9.0, 11.0)
        panels = figure.subplots(6, 1, sharex=True)
        _pair(panels[0], passive, active, shown, "sprung_accel", 1.0, "acceleration\n[m/s²]")
        _pair(panels[1], passive, active, shown, "susp_deflection", 1e3, "deflection\n[mm]")
        _pair(panels[2], passive, active, shown, "tyre_load", 1e-3, "tyre load\n[kN]")
        time = np.asarray(active.time)[shown]
        panels[3].plot(time, np.degrees(np.asarray(active.link_angle)[shown]), **ACTIVE)
        panels[3].set_ylabel("link angle\n[deg]")
        speed = ratio * RPM * np.asarray(active.link_velocity)[shown]
        _limited(panels[4], time, speed, float(p["motor_speed_limit"]) * RPM)
        panels[4].set_ylabel("motor speed\n[1/min]")
        power = np.asarray(active.shaft_power)[shown]
        _limited(panels[5], time, power, float(p["motor_peak_power"]))
        panels[5].set_ylabel("power at the\nmotor's shaft [W]")
        panels[5].set_xlabel("time [s]")
        handles = [*panels[0].get_legend_handles_labels()[0], *panels[4].get_legend_handles_labels()[0]]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        panels[0].set_title(printable(study.test.title), y=1.3 if study.test.sweeps else 1.0)
        if study.test.sweeps is not None:
            _frequency_on_top(panels[0], study.test.sweeps, study.test.end)
        figure.align_ylabels(panels)
    return figure


def _shown(study: LoopStudy) -> np.ndarray:
    """The samples that are drawn: of a harmonic test the last evaluated seconds, of any other test all."""
    time, test = np.asarray(study.active.signals.time), study.test
    if test.name is LoopKind.harmonic:
        return (time >= test.end - PERIODS) & (time < test.end)
    return time < test.end + 1.0


def _pair(
    axes: Axes, passive: Signals, active: Signals, shown: np.ndarray, name: str, scale: float, label: str
) -> None:
    for signals, look, who in ((passive, PASSIVE, "passive"), (active, ACTIVE, "active")):
        time, values = np.asarray(signals.time)[shown], np.asarray(getattr(signals, name))[shown]
        axes.plot(time, scale * values, label=who, **look)
    axes.set_ylabel(label)


def _limited(axes: Axes, time: np.ndarray, values: np.ndarray, limit: float) -> None:
    axes.plot(time, values, **ACTIVE)
    for place, bound in enumerate((-limit, limit)):
        axes.axhline(bound, label="limit of the drive" if place else None, **LIMIT)


def _frequency_on_top(axes: Axes, sweeps: tuple[float, float], end: float) -> None:
    low, high = sweeps
    slope = (high - low) / end

    def frequency_at(time: Any) -> Any:
        return low + slope * time

    def time_of(frequency: Any) -> Any:
        return (frequency - low) / slope

    top = axes.secondary_xaxis("top", functions=(frequency_at, time_of))
    top.set_xlabel("road frequency [Hz]")


def failures_figure(study: LoopStudy) -> Figure:
    """Acceleration and link angle around each failure, with the passive rig's acceleration."""
    at = study.test.fails_at
    with styled():
        figure = new_figure(11.0, 2.0 + 1.7 * len(study.failures))
        panels = figure.subplots(len(study.failures), 2, sharex=True, squeeze=False)
        for row, failed in zip(panels, study.failures, strict=True):
            time = np.asarray(failed.run.signals.time)
            shown = (time >= at - 1.0) & (time < at + 4.0)
            passive = np.asarray(study.passive.signals.sprung_accel)[shown]
            row[0].plot(time[shown], passive, label="passive", **PASSIVE)
            accel = np.asarray(failed.run.signals.sprung_accel)[shown]
            row[0].plot(time[shown], accel, label="with the failure", **ACTIVE)
            row[0].set_ylabel("acceleration\n[m/s²]")
            angle = np.degrees(np.asarray(failed.run.signals.link_angle)[shown])
            row[1].plot(time[shown], angle, **ACTIVE)
            row[1].set_ylabel("link angle\n[deg]")
            for axes in row:
                axes.axvline(at, color=INK, linewidth=0.9, linestyle=":")
            row[0].set_title(KINDS[failed.kind].about, loc="left", fontsize=9)
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
    return figure


def rigs_figure(study: LoopStudy) -> Figure:
    """What the loop gains on every rig that it was tried on; the numbers of the paper with it for its own test."""
    accel = [each.gain.sprung_accel for each in study.on_rigs]
    deflection = [each.gain.susp_deflection for each in study.on_rigs]
    stable = np.array([each.stable for each in study.on_rigs])
    with styled():
        figure = new_figure(6.4, 4.6)
        axes = figure.subplots()
        looks: tuple[tuple[bool, dict[str, Any]], ...] = (
            (True, {"marker": "o", "color": BLUE}),
            (False, {"marker": "x", "color": ORANGE}),
        )
        for wanted, look in looks:
            chosen = stable == wanted
            if chosen.any():
                word = "rig that the data allow, stable" if wanted else "not stable"
                axes.scatter(np.array(accel)[chosen], np.array(deflection)[chosen], s=26, label=word, **look)
        own = study.gain
        axes.scatter(
            own.sprung_accel,
            own.susp_deflection,
            s=120,
            marker="*",
            color=INK,
            label="the rig itself",
            zorder=5,
        )
        if study.test.name is LoopKind.harmonic:
            axes.scatter(*PAPER, s=60, marker="D", facecolors="white", edgecolors=INK, label="paper, at 2 Hz")
        axes.set_xlabel("fall of the rms acceleration [%]")
        axes.set_ylabel("fall of the rms deflection [%]")
        axes.legend(loc="best")
    return figure


def causes_figure(study: LoopStudy) -> Figure:
    """What the loop gains with one imperfection taken away at a time."""
    names = [each.variant for each in study.causes]
    place = np.arange(len(names))
    with styled():
        figure = new_figure(8.5, 1.4 + 0.42 * len(names))
        axes = figure.subplots()
        for offset, name, colour, word in (
            (-0.2, "sprung_accel", BLUE, "acceleration"),
            (0.2, "susp_deflection", ORANGE, "deflection"),
        ):
            values = [getattr(each.gain, name) for each in study.causes]
            axes.barh(place + offset, values, height=0.36, color=colour, label=word)
            for at, value in zip(place + offset, values, strict=True):
                axes.annotate(
                    f"{value:.1f}", (value, at), (3, 0), textcoords="offset points", va="center", fontsize=8
                )
        axes.set_yticks(place, [printable(name) for name in names])
        axes.invert_yaxis()
        axes.margins(x=0.1)
        axes.set_xlabel("fall of the rms, active against passive [%]")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return figure
