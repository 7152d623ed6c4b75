"""The report of a diagnosis: one page that an engineer reads from the top down.

Whether the verdict may be used comes first, then the verdict in one sentence, then where on the rig, what it does to
the response, what the port needs, what else it could be, how far the gap shrinks, what to test next, and from what
all this follows.
"""

import numpy as np

from savgs_ident.diagnose.result import Diagnosis, ForceLoop
from savgs_ident.report.diagnosis_bode import compared_channels, diagnosis_bode_figure, first_harmonic_gap
from savgs_ident.report.diagnosis_force import force_figure, spread_loops
from savgs_ident.report.diagnosis_map import gap_channels, gap_map_figure, gap_table
from savgs_ident.report.diagnosis_rig import rig_figure
from savgs_ident.report.diagnosis_rows import (
    candidate_row,
    channel_words,
    cycle_row,
    parameter_table,
    port_row,
    shrink_table,
)
from savgs_ident.report.diagnosis_shrink import shrink_figure
from savgs_ident.report.diagnosis_words import (
    KIND_WORDS,
    alarm,
    baseline_sentence,
    gap_percentage,
    law_label,
    port_words,
    probability_words,
    references,
    shown_candidates,
    smallest_words,
)
from savgs_ident.report.html import Picture, embed, render_page
from savgs_ident.report.numerals import DASH, decimal, percentage, signed
from savgs_ident.report.origin import Origin
from savgs_ident.report.readings import READINGS


def diagnosis_html(diagnosis: Diagnosis, origin: Origin) -> str:
    """The page: one file, no network, nothing executed; the same diagnosis gives the same bytes."""
    shown, rest = shown_candidates(diagnosis)
    verdict = diagnosis.verdict
    return render_page(
        "diagnosis.html.j2",
        {
            "rig": diagnosis.rig.name,
            "origin": origin,
            "alarm": alarm(diagnosis),
            "verdict": verdict,
            # A number and its per cent stay on one line.
            "sentence": verdict.sentence.replace(" %", "\u00a0%"),
            "named": " + ".join(verdict.effects) or "its verdict",
            "baseline": baseline_sentence(diagnosis),
            "facts": _facts(diagnosis),
            "warnings": diagnosis.warnings,
            "rig_picture": _rig(diagnosis),
            "ports": [port_row(each, diagnosis) for each in diagnosis.ports],
            "bode": [_bode(diagnosis, c) for c in compared_channels(diagnosis)],
            "loops": [_loop(diagnosis, each) for each in spread_loops(diagnosis.loops)],
            "lawful": any(each.law.size for each in diagnosis.loops),
            "shown": [candidate_row(each, diagnosis) for each in shown],
            "rest": [candidate_row(each, diagnosis) for each in rest],
            "references": references(verdict.effects),
            "parameters": [
                (each.name, each.about, each.given, each.recalibrated, each.identified, each.moved, each.unit)
                for each in parameter_table(diagnosis)
            ],
            "shrink_picture": _shrink(diagnosis),
            "shrink": shrink_table(diagnosis),
            "maps": [_map(diagnosis, channel) for channel in gap_channels(diagnosis)],
            "cycle": [
                (each.name, each.reversal, each.between, each.mid_stroke)
                for each in map(cycle_row, diagnosis.cycle)
            ],
            "next_tests": [
                (each.test, " from ".join(each.separates), decimal(each.expected_sigma, 1))
                for each in diagnosis.next_tests
            ],
            "confusable": [(*each.effects, signed(each.cosine, 3)) for each in diagnosis.confusable],
            "not_judgeable": [
                (each.effect, each.parameter, smallest_words(each)) for each in diagnosis.not_judgeable
            ],
        },
    )


def _facts(diagnosis: Diagnosis) -> tuple[dict[str, object], ...]:
    """Four numbers that tell at a glance what was found."""
    verdict, shrink = diagnosis.verdict, diagnosis.shrink
    said = verdict.effects or (verdict.kind,)
    named = next((each for each in diagnosis.candidates if (each.effects or (each.name,)) == said), None)
    low, high = (percentage(end) for end in shrink.interval)
    known = np.isfinite(shrink.share_closed)
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
            "name": "Share closed",
            "value": percentage(shrink.share_closed),
            "then": f"95 %: {low} to {high}" if known else "nothing to close",
            "bad": False,
        },
    )


def _rig(diagnosis: Diagnosis) -> Picture:
    told = ", ".join(f"{port_words(each.port)} {percentage(each.share, 0)}" for each in diagnosis.ports)
    guilty = " and ".join(map(port_words, diagnosis.verdict.ports)) or "none"
    words = f"The rig with its ports. Guilty port: {guilty}. Shares of the gap: {told or 'not known'}."
    return embed(rig_figure(diagnosis), words)


def _bode(diagnosis: Diagnosis, c: int) -> Picture:
    gap = first_harmonic_gap(diagnosis, c)
    largest = [
        f"{name} {np.max(values[np.isfinite(values)], initial=0.0):.3g} %"
        for name, values in (
            ("before", gap.before),
            ("recalibrated", gap.recalibrated),
            ("after", gap.after),
        )
    ]
    title = tuple(READINGS.values())[c].title
    words = f"Magnitude, phase and gap of the {title} over road frequency; largest gap {', '.join(largest)}."
    return embed(diagnosis_bode_figure(diagnosis, c), words)


def _loop(diagnosis: Diagnosis, loop: ForceLoop) -> Picture:
    largest = float(np.max(np.abs(loop.inferred), initial=0.0))
    words = (
        f"Signal inferred at the {port_words(loop.port)} over velocity and displacement at"
        f" {loop.frequency_hz:.3g} Hz; it reaches {largest:.3g} {loop.unit}."
    )
    return embed(force_figure(loop, law_label(diagnosis, loop.port)), words)


def _shrink(diagnosis: Diagnosis) -> Picture:
    each = diagnosis.shrink
    words = (
        f"Gap on tests left out: {gap_percentage(each.before)} before, {gap_percentage(each.recalibrated)}"
        f" recalibrated, {gap_percentage(each.after)} after, {gap_percentage(each.floor)} noise alone."
    )
    return embed(shrink_figure(diagnosis), words)


def _map(diagnosis: Diagnosis, channel: str) -> Picture:
    frequency, orders, sigma, _ = gap_table(diagnosis.map, channel)
    words = f"Gap of the {channel_words(channel).lower()} by dwell and harmonic order."
    known = np.where(np.isfinite(sigma), np.abs(sigma), -1.0)
    k, d = np.unravel_index(np.argmax(known), known.shape)
    words += f" Largest: {known[k, d]:.0f} standard deviations in order {orders[k]} at {frequency[d]:.3g} Hz."
    return embed(gap_map_figure(diagnosis, channel), words)
