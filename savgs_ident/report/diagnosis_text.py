"""A diagnosis in the terminal: the verdict first, then how far the gap shrinks, what else it could be, next tests."""

from collections.abc import Iterator
from math import isfinite

from rich.console import Group, RenderableType

from savgs_ident.diagnose.result import Diagnosis, Shrink
from savgs_ident.report.diagnosis_words import (
    alarm,
    baseline_sentence,
    closed_words,
    estimate_words,
    gain_words,
    gap_percentage,
    port_words,
    probability_words,
    shown_candidates,
    sigma_words,
    smallest_words,
)
from savgs_ident.report.numerals import DASH, decimal, percentage
from savgs_ident.report.readings import READINGS
from savgs_ident.report.terminal import plain, table

_SHOWN_PORTS = 3


def diagnosis_text(diagnosis: Diagnosis) -> RenderableType:
    """Sentences and tables of a diagnosis, most important first."""
    warned = alarm(diagnosis)
    return Group(
        *([plain(warned, "bold")] if warned else []),
        plain(diagnosis.verdict.sentence, "bold"),
        plain(baseline_sentence(diagnosis)),
        plain(""),
        _gap(diagnosis),
        *_ports(diagnosis),
        _candidates(diagnosis),
        *_parameters(diagnosis),
        *_confusable(diagnosis),
        *_next_tests(diagnosis),
        *_not_judgeable(diagnosis),
        *_warnings(diagnosis),
    )


def _gap(diagnosis: Diagnosis) -> RenderableType:
    def cells(name: str, each: Shrink) -> tuple[str, ...]:
        gaps = (each.before, each.recalibrated, each.after, each.floor)
        return (name, *map(gap_percentage, gaps), closed_words(each))

    rows = [cells("together", diagnosis.shrink)]
    rows += [cells(_channel(name), each) for name, each in diagnosis.by_channel.items()]
    if diagnosis.sweep is not None:
        swept = diagnosis.sweep
        gaps = (swept.before, swept.recalibrated, swept.after, swept.floor)
        rows.append(("sweep, first harmonic", *map(gap_percentage, gaps), DASH))
    headers = ("gap on tests left out", "before", "recali-\nbrated", "after", "floor", "share closed (95 %)")
    return table("How far it shrinks", headers, rows)


def _channel(name: str) -> str:
    return READINGS[name].title.removeprefix("sprung-mass ") if name in READINGS else name


def _ports(diagnosis: Diagnosis) -> list[RenderableType]:
    shown = [
        f"{port_words(each.port)} {percentage(each.share, 0)}" for each in diagnosis.ports[:_SHOWN_PORTS]
    ]
    text = "Share of the recalibrated gap that a law at one port carries: "
    return [plain(f"{text}{', '.join(shown)}."), plain("")] if shown else []


def _candidates(diagnosis: Diagnosis) -> RenderableType:
    every = diagnosis.candidates
    shown, _ = shown_candidates(diagnosis)
    rows = [
        (
            each.name,
            probability_words(each.probability),
            sigma_words(each.score_sigma),
            gain_words(each.heldout_gain),
            percentage(each.share_closed),
        )
        for each in shown
    ]
    headers = ("hypothesis", "probability", "score\n[sd]", "held-out gain\n[nat per datum]", "share\nclosed")
    title = f"What it could be ({len(shown)} of {len(every)} hypotheses)"
    return table(title, headers, rows)


def _parameters(diagnosis: Diagnosis) -> Iterator[RenderableType]:
    """Of the hypothesis that the verdict names."""
    named = [each for each in diagnosis.candidates if each.effects == diagnosis.verdict.effects]
    estimates = named[0].parameters if named and diagnosis.verdict.effects else ()
    if estimates:
        yield plain("Its parameters, with 95 % intervals", "bold")
        yield from (plain(f"- {each.name}: {estimate_words(each)}") for each in estimates)
        yield plain("")


def _confusable(diagnosis: Diagnosis) -> list[RenderableType]:
    others = ", ".join(diagnosis.verdict.confusable_with)
    return [plain(f"This campaign cannot tell it from: {others}."), plain("")] if others else []


def _next_tests(diagnosis: Diagnosis) -> list[RenderableType]:
    if not diagnosis.next_tests:
        return []
    rows = [
        (each.test, " from ".join(each.separates), decimal(each.expected_sigma, 1))
        for each in diagnosis.next_tests
    ]
    return [table("What to test next", ("test", "tells", "expected\n[sd]"), rows, texts=(0, 1))]


def _not_judgeable(diagnosis: Diagnosis) -> Iterator[RenderableType]:
    if diagnosis.not_judgeable:
        yield plain("This campaign cannot show", "bold")
    for each in diagnosis.not_judgeable:
        size = smallest_words(each)
        limit = f"unless its {each.parameter} is at least {size}" if isfinite(each.smallest) else size
        yield plain(f"- {each.effect}, {limit}")


def _warnings(diagnosis: Diagnosis) -> Iterator[RenderableType]:
    if diagnosis.warnings:
        yield plain("")
        yield plain("What to know", "bold")
    yield from (plain(f"- {warning}") for warning in diagnosis.warnings)
