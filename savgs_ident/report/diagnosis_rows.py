"""The rows of a diagnosis's tables, every cell a text."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite, nan

from savgs_ident.core.parameter import Parameter
from savgs_ident.diagnose.result import Candidate, CyclePosition, Diagnosis, PortShare, Shrink
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.report.diagnosis_words import (
    about_candidate,
    closed_words,
    estimate_words,
    gain_words,
    gap_percentage,
    port_words,
    probability_words,
    sigma_words,
)
from savgs_ident.report.numerals import DASH, numeral, percentage, signed, unit_text
from savgs_ident.report.readings import READINGS

_SAME = 1e-9


@dataclass(frozen=True)
class Bar:
    """A share of a whole as a bar: its length in per cent, and in words."""

    length: float
    words: str


@dataclass(frozen=True)
class CandidateRow:
    """A hypothesis; ``parameters`` are pairs of name and value with interval."""

    name: str
    about: str
    named: bool
    probability: str
    bar: Bar
    score: str
    gain: str
    closed: str
    judged: str
    parameters: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class PortRow:
    """A port; ``guilty`` where the verdict names it."""

    port: str
    words: str
    guilty: bool
    share: str
    bar: Bar
    reach: str


@dataclass(frozen=True)
class ShrinkRow:
    """The gap of a channel, of both, or of the sweep."""

    name: str
    before: str
    recalibrated: str
    after: str
    floor: str
    closed: str


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


def candidate_row(each: Candidate, diagnosis: Diagnosis) -> CandidateRow:
    """One line of the table of hypotheses."""
    return CandidateRow(
        name=each.name,
        about=about_candidate(each),
        named=bool(each.effects) and each.effects == diagnosis.verdict.effects,
        probability=probability_words(each.probability),
        bar=_bar(each.probability),
        score=sigma_words(each.score_sigma),
        gain=gain_words(each.heldout_gain),
        closed=percentage(each.share_closed),
        judged="fitted in full" if each.refitted else "judged by its score",
        parameters=tuple((estimate.name, estimate_words(estimate)) for estimate in each.parameters),
    )


def port_row(each: PortShare, diagnosis: Diagnosis) -> PortRow:
    """One line of the table of ports."""
    guilty = each.port in diagnosis.verdict.ports
    return PortRow(
        each.port,
        port_words(each.port),
        guilty,
        percentage(each.share),
        _bar(each.share),
        percentage(each.reach),
    )


def shrink_table(diagnosis: Diagnosis) -> tuple[ShrinkRow, ...]:
    """Both channels together, each channel, and the sweep if one was recorded."""
    rows = [_shrink_row("Both channels together", diagnosis.shrink)]
    rows += [_shrink_row(channel_words(name), each) for name, each in diagnosis.by_channel.items()]
    if diagnosis.sweep is not None:
        swept = diagnosis.sweep
        rows.append(
            ShrinkRow(
                name="Recorded sweep, first harmonic",
                before=gap_percentage(swept.before),
                recalibrated=gap_percentage(swept.recalibrated),
                after=gap_percentage(swept.after),
                floor=gap_percentage(swept.floor),
                closed=DASH,
            )
        )
    return tuple(rows)


def cycle_row(each: CyclePosition) -> CycleRow:
    """One line of the table of where in the cycle."""
    shares = (percentage(share, 0) for share in (each.reversal, each.between, each.mid_stroke))
    return CycleRow(channel_words(each.channel), *shares)


def parameter_table(diagnosis: Diagnosis) -> tuple[ParameterRow, ...]:
    """The parameters that calibration or the named effects moved, and those that the effects brought along."""
    return tuple(_parameter_rows(diagnosis))


def channel_words(name: str) -> str:
    """A channel as reports call it, with a capital."""
    title = READINGS[name].title if name in READINGS else name
    return f"{title[:1].upper()}{title[1:]}"


def _shrink_row(name: str, each: Shrink) -> ShrinkRow:
    return ShrinkRow(
        name=name,
        before=gap_percentage(each.before),
        recalibrated=gap_percentage(each.recalibrated),
        after=gap_percentage(each.after),
        floor=gap_percentage(each.floor),
        closed=closed_words(each),
    )


def _bar(share: float) -> Bar:
    length = 100.0 * min(max(share, 0.0), 1.0) if isfinite(share) else 0.0
    return Bar(round(length, 2), percentage(share))


def _parameter_rows(diagnosis: Diagnosis) -> Iterator[ParameterRow]:
    given = diagnosis.rig.parameters
    known = {each.name: each for effect in CATALOGUE.values() for each in effect.parameters} | dict(given)
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
    if about is None or not about.tolerance > 0.0 or given is None or identified is None:
        return DASH
    return signed((identified - given) / about.tolerance, 1)


def _number(value: float | None) -> str:
    return DASH if value is None else numeral(value, nan)
