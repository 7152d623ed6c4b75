"""The report of a diagnosis: one page that an engineer reads from the top down.

Whether the verdict may be used comes first, then the verdict in one sentence, the port on the rig, the response, the
signal inferred at the port, the other hypotheses, the gap by model, the next tests, and the data behind all this.
Every cell of a table is a text that was rounded here.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.presentation import Origin
from savgs_ident.diagnosis.gap import CyclePosition, Shrink
from savgs_ident.diagnosis.result import Diagnosis, ForceLoop, PortShare
from savgs_ident.report.by_plant import report_of
from savgs_ident.report.diagnosis.compared import bode_picture, compared_channels, drive_picture
from savgs_ident.report.diagnosis.figures import (
    gap_channels,
    gap_map_figure,
    gap_table,
    regime_note,
    regime_picture,
    shrink_figure,
)
from savgs_ident.report.diagnosis.gap_spectra import gap_spectrum_pictures
from savgs_ident.report.diagnosis.hypotheses import candidate_row, named_hypotheses, nested_bars
from savgs_ident.report.diagnosis.loop_figures import force_figure, loop_time, spread_loops
from savgs_ident.report.diagnosis.text import (
    KIND_WORDS,
    alarm,
    baseline_sentence,
    closed_words,
    gap_percentage,
    port_words,
    probability_words,
    references,
    shown_candidates,
    smallest_words,
)
from savgs_ident.report.html import Picture, embed, render_page
from savgs_ident.report.text import (
    DASH,
    channel_label,
    decimal,
    numeral,
    per_input_words,
    percentage,
    signed,
    unit_text,
)
from savgs_ident.responses.selection import by_kind

_SAME = 1e-9


@dataclass(frozen=True)
class Bar:
    """A share of a whole as a bar: its length in per cent, and in words."""

    length: float
    words: str


@dataclass(frozen=True)
class PortRow:
    """A port; ``named`` where the verdict names it."""

    port: str
    words: str
    named: bool
    share: str
    bar: Bar
    free_input_share: str


@dataclass(frozen=True)
class ShrinkRow:
    """The gap of a channel, of both, or of a recording that took no part."""

    name: str
    before: str
    recalibrated: str
    after: str
    floor: str
    by_calibration: str
    by_effect: str


@dataclass(frozen=True)
class CycleRow:
    """Where in the cycle of the body's velocity the gap of a channel lies."""

    name: str
    reversal: str
    between: str
    mid_stroke: str


@dataclass(frozen=True)
class ParameterRow:
    """A parameter before, recalibrated, and with what is named; ``moved`` in tolerances."""

    name: str
    about: str
    given: str
    recalibrated: str
    identified: str
    moved: str
    unit: str


def port_row(each: PortShare, diagnosis: Diagnosis) -> PortRow:
    """One line of the table of ports."""
    named = each.port in diagnosis.verdict.ports
    return PortRow(
        each.port,
        port_words(diagnosis, each.port),
        named,
        percentage(each.share),
        _bar(each.share),
        percentage(each.free_input_share) if _has_free_inputs(diagnosis) else DASH,
    )


def _has_free_inputs(diagnosis: Diagnosis) -> bool:
    """Whether a signal was free in any test: it is in dwells, and along a drive's motion."""
    return diagnosis.measured is None or diagnosis.measured.dwells.size > 0


def shrink_table(diagnosis: Diagnosis) -> tuple[ShrinkRow, ...]:
    """All channels together, each channel, and the recording that took no part, if there is one."""
    both = len(diagnosis.given.channels) == 2
    rows = [_shrink_row("Both channels together" if both else "All channels together", diagnosis.shrink)]
    rows += [
        _shrink_row(channel_label(name, diagnosis.given).heading, each)
        for name, each in diagnosis.by_channel.items()
    ]
    if diagnosis.further is not None:
        other = diagnosis.further
        rows.append(
            ShrinkRow(
                name=f"{other.name[:1].upper()}{other.name[1:]}",
                before=gap_percentage(other.before),
                recalibrated=gap_percentage(other.recalibrated),
                after=gap_percentage(other.after),
                floor=gap_percentage(other.floor),
                by_calibration=DASH,
                by_effect=DASH,
            )
        )
    return tuple(rows)


def cycle_row(each: CyclePosition, diagnosis: Diagnosis) -> CycleRow:
    """One line of the table of where in the cycle."""
    shares = (percentage(share, 0) for share in (each.reversal, each.between, each.mid_stroke))
    return CycleRow(channel_label(each.channel, diagnosis.given).heading, *shares)


def parameter_table(diagnosis: Diagnosis) -> tuple[ParameterRow, ...]:
    """The parameters that calibration or the named effects moved, and those that the effects brought along."""
    return tuple(_parameter_rows(diagnosis))


def _shrink_row(name: str, each: Shrink) -> ShrinkRow:
    by_calibration, by_effect = closed_words(each)
    return ShrinkRow(
        name=name,
        before=gap_percentage(each.before),
        recalibrated=gap_percentage(each.recalibrated),
        after=gap_percentage(each.after),
        floor=gap_percentage(each.floor),
        by_calibration=by_calibration,
        by_effect=by_effect,
    )


def _bar(share: float) -> Bar:
    length = 100.0 * min(max(share, 0.0), 1.0) if isfinite(share) else 0.0
    return Bar(round(length, 2), percentage(share))


def _parameter_rows(diagnosis: Diagnosis) -> Iterator[ParameterRow]:
    given, catalogue = diagnosis.given.table, diagnosis.given.catalogue
    known = {each.name: each for effect in catalogue.values() for each in effect.parameters} | dict(given)
    for name in dict.fromkeys((*diagnosis.parameters, *diagnosis.identified)):
        recalibrated, identified = diagnosis.parameters.get(name), diagnosis.identified.get(name)
        before = given[name].value if name in given else None
        if before is None or any(
            after is not None and abs(after - before) > _SAME * abs(before)
            for after in (recalibrated, identified)
        ):
            about = known.get(name)
            yield ParameterRow(
                name=name,
                about=about.about.split(",")[0] if about else "",
                given=_number(before),
                recalibrated=_number(recalibrated),
                identified=_number(identified),
                moved=_moved(about, before, identified),
                unit=unit_text(about.unit) if about else DASH,
            )


def _moved(about: Parameter | None, given: float | None, identified: float | None) -> str:
    if about is None or about.is_typical or not about.tolerance > 0.0 or given is None or identified is None:
        return DASH
    return signed((identified - given) / about.tolerance, 1)


def _number(value: float | None) -> str:
    return DASH if value is None else numeral(value, nan)


def diagnosis_html(diagnosis: Diagnosis, origin: Origin) -> str:
    """The page: one file, no network, nothing executed; the same diagnosis gives the same bytes."""
    shown, rest = shown_candidates(diagnosis)
    verdict, (dwells, windows) = diagnosis.verdict, by_kind(diagnosis)
    return render_page(
        "diagnosis.html.j2",
        {
            "rig": diagnosis.given.plant_name,
            "origin": origin,
            "alarm": alarm(diagnosis),
            "verdict": verdict,
            "sentence": verdict.sentence,
            "named": " + ".join(verdict.effects) or "its verdict",
            "baseline": baseline_sentence(diagnosis),
            "per_input": per_input_words(diagnosis.given),
            "facts": _facts(diagnosis),
            "warnings": diagnosis.warnings,
            "rig_picture": _rig(diagnosis),
            "rig_legend": report_of(diagnosis.given).legend,
            "ports": [port_row(each, diagnosis) for each in diagnosis.ports],
            "drive": drive_picture(diagnosis),
            "dwells": dwells is not None,
            "windows": windows is not None,
            "spectra": [] if windows is None else gap_spectrum_pictures(windows),
            "bode": [] if dwells is None else [bode_picture(dwells, c) for c in compared_channels(dwells)],
            "loops": [_loop(diagnosis, each) for each in spread_loops(diagnosis.loops)],
            "lawful": any(each.law.size for each in diagnosis.loops),
            "nearest": any(each.nearest.size for each in diagnosis.loops),
            "tree": nested_bars(diagnosis),
            "shown": [candidate_row(each, diagnosis) for each in shown],
            "rest": [candidate_row(each, diagnosis) for each in rest],
            "references": references(diagnosis),
            "parameters": [
                (each.name, each.about, each.given, each.recalibrated, each.identified, each.moved, each.unit)
                for each in parameter_table(diagnosis)
            ],
            "shrink_picture": _shrink(diagnosis),
            "shrink": shrink_table(diagnosis),
            "maps": [_map(diagnosis, channel) for channel in gap_channels(diagnosis)],
            "cycle": [
                (each.name, each.reversal, each.between, each.mid_stroke)
                for each in (cycle_row(one, diagnosis) for one in diagnosis.cycle)
            ],
            "regimes": regime_picture(diagnosis),
            "regime_note": regime_note(diagnosis),
            "next_tests": [
                (each.test, " from ".join(map(str, each.separates)), decimal(each.expected_sigma, 1))
                for each in diagnosis.next_tests
            ],
            "confusable": [(*each.effects, signed(each.cosine, 3)) for each in diagnosis.confusable],
            "not_judgeable": [
                (each.effect, each.parameter, smallest_words(each)) for each in diagnosis.not_judgeable
            ],
        },
    )


def _facts(diagnosis: Diagnosis) -> tuple[dict[str, object], ...]:
    """Four numbers for a first look."""
    verdict, shrink = diagnosis.verdict, diagnosis.shrink
    said = named_hypotheses(verdict)
    named = next((each for each in diagnosis.candidates if each.hypothesis in said), None)
    calibrated = np.isfinite(shrink.closed_by_calibration)
    return (
        {
            "name": "Missing",
            "value": KIND_WORDS[verdict.kind],
            "then": f"probability {probability_words(named.probability)}" if named else DASH,
            "bad": not diagnosis.converged,
        },
        {
            "name": "Gap before",
            "value": gap_percentage(shrink.before),
            "then": f"recalibrated {gap_percentage(shrink.recalibrated)}",
            "bad": False,
        },
        {
            "name": "Gap after",
            "value": gap_percentage(shrink.after),
            "then": f"noise alone {gap_percentage(shrink.floor)}",
            "bad": False,
        },
        {
            "name": "Closed by what was found",
            "value": percentage(shrink.closed_by_effect),
            "then": f"calibration closed {percentage(shrink.closed_by_calibration)}"
            if calibrated
            else "nothing to close",
            "bad": False,
        },
    )


def _rig(diagnosis: Diagnosis) -> Picture:
    """The ports in the drawing of the plant."""
    shares = ", ".join(
        f"{port_words(diagnosis, each.port)} {percentage(each.share, 0)}" for each in diagnosis.ports
    )
    named = " and ".join(port_words(diagnosis, port) for port in diagnosis.verdict.ports) or "none"
    words = f"The plant with its ports. Named port: {named}. Shares of the gap: {shares or 'not known'}."
    return embed(report_of(diagnosis.given).ports_figure(diagnosis), words)


def _loop(diagnosis: Diagnosis, loop: ForceLoop) -> Picture:
    signal, what = (
        (loop.inferred, "Signal inferred") if loop.inferred.size else (loop.law, "Law that is named")
    )
    largest = float(np.max(np.abs(signal), initial=0.0))
    words = (
        f"{what} at the {port_words(diagnosis, loop.port)} over velocity and displacement"
        f" {loop_time(diagnosis, loop)}; it reaches {largest:.3g} {loop.unit}."
    )
    return embed(force_figure(diagnosis, loop), words)


def _shrink(diagnosis: Diagnosis) -> Picture:
    each = diagnosis.shrink
    words = (
        f"Gap on held-out tests: {gap_percentage(each.before)} before, {gap_percentage(each.recalibrated)}"
        f" recalibrated, {gap_percentage(each.after)} after, {gap_percentage(each.floor)} noise alone."
    )
    return embed(shrink_figure(diagnosis), words)


def _map(diagnosis: Diagnosis, channel: str) -> Picture:
    frequency, orders, sigma, _ = gap_table(diagnosis.map, channel)
    words = f"Gap of the {channel_label(channel, diagnosis.given).title} by dwell and harmonic order."
    known = np.where(np.isfinite(sigma), np.abs(sigma), -1.0)
    k, d = np.unravel_index(np.argmax(known), known.shape)
    words += f" Largest: {known[k, d]:.0f} standard deviations in order {orders[k]} at {frequency[d]:.3g} Hz."
    return embed(gap_map_figure(diagnosis, channel), words)
