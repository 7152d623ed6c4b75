"""A diagnosis in words: the texts that terminal and page share, and the report in the terminal.

The terminal shows the verdict first, then the gaps, the hypotheses with their probabilities and the next tests.
"""

from collections.abc import Iterator, Mapping
from math import floor, isfinite, log10
from types import MappingProxyType

from rich.console import Group, RenderableType

from savgs_ident.diagnosis.gap import Shrink
from savgs_ident.diagnosis.result import NONE, Candidate, Diagnosis, DriveForces, Estimate, NotJudgeable
from savgs_ident.effects.base import PortKind
from savgs_ident.report.text import (
    DASH,
    channel_label,
    counted,
    decimal,
    interval,
    numeral,
    percentage,
    plain,
    signed,
    table,
    unit_text,
)

KIND_WORDS: Mapping[str, str] = MappingProxyType(
    {"none": "nothing", "effect": "one effect", "several": "several effects", "unknown": "unknown"}
)
"""The kinds of verdict: what is missing."""

LEVEL = 0.05
"""P-values below are significant: a regime is named."""

SMALL = 0.001
"""Hypotheses, and ports, families and laws, that are less probable are not shown each."""

_SHOWN = 5


def alarm(diagnosis: Diagnosis) -> str | None:
    """What must be read before the verdict; None where it may be used."""
    if diagnosis.converged:
        return None
    return "Not converged: this verdict must not be used."


def port_words(diagnosis: Diagnosis, port: str) -> str:
    """A port in words; its name where there are none."""
    return diagnosis.given.plant.location_words.get(port, port)


def symptoms(diagnosis: Diagnosis, effects: tuple[str, ...]) -> tuple[str, ...]:
    """What each effect that the catalogue has is known by, a sentence each."""
    catalogue = diagnosis.given.catalogue
    texts = (catalogue[name].symptom for name in effects if name in catalogue)
    return tuple(f"{text[:1].upper()}{text[1:]}." for text in texts)


def references(diagnosis: Diagnosis) -> tuple[tuple[str, str], ...]:
    """The named effects that the catalogue has, each with where its law is from."""
    catalogue = diagnosis.given.catalogue
    return tuple((name, catalogue[name].reference) for name in diagnosis.verdict.effects if name in catalogue)


def about_candidate(diagnosis: Diagnosis, candidate: Candidate) -> str:
    """What a hypothesis says, in a sentence."""
    if candidate.effects:
        return " ".join(symptoms(diagnosis, candidate.effects))
    if candidate.hypothesis == NONE:
        return "The recalibrated baseline is complete."
    learned = candidate.hypothesis.flexible
    if learned:
        kind, place = learned.family.value.capitalize(), port_words(diagnosis, learned.port)
        return f"{kind} at {place}, by a law that was learned from the data."
    return "An effect that is not in the catalogue."


def shown_candidates(diagnosis: Diagnosis) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """The hypotheses worth reading, and the others: the first few, all with a chance, and "none" and "unknown"."""
    worth = [
        place < _SHOWN or each.probability >= SMALL or not each.effects
        for place, each in enumerate(diagnosis.candidates)
    ]
    return (
        tuple(each for each, listed in zip(diagnosis.candidates, worth, strict=True) if listed),
        tuple(each for each, listed in zip(diagnosis.candidates, worth, strict=True) if not listed),
    )


def model_label(diagnosis: Diagnosis) -> str:
    """What the model after the diagnosis is called in a legend."""
    verdict = diagnosis.verdict
    if verdict.effects and verdict.law_known:
        return f"with {' + '.join(verdict.effects)}"
    if verdict.kind != "none":
        return "with the learned law"
    return "after (nothing added)"


def law_label(diagnosis: Diagnosis, port: str) -> str:
    """What the law of the named effects at a port is called in a legend."""
    if not diagnosis.verdict.law_known:
        return "learned law"
    named, known = diagnosis.verdict.effects, diagnosis.given.catalogue
    there = [name for name in named if name in known and known[name].port.location == port]
    return f"law of {' + '.join(there or named)}"


def baseline_sentence(diagnosis: Diagnosis) -> str:
    """What was compared with what."""
    measured, forces = diagnosis.measured, diagnosis.responses
    effects = " and ".join(diagnosis.effects) or "no effect of the catalogue"
    if isinstance(forces, DriveForces):
        seconds = forces.time[-1] - forces.time[0]
        return (
            f"Baseline {diagnosis.model} with {effects}, compared with the force of the drive along {seconds:.1f} s "
            f"of motion; computed in {diagnosis.wall_s:.0f} s."
        )
    assert measured is not None
    compared = []
    if measured.dwells.size:
        hertz = measured.frequency[measured.dwells]
        compared.append(f"{counted(hertz.size, 'dwell')} between {hertz[0]:.2f} and {hertz[-1]:.2f} Hz")
    if measured.windows.size:
        compared.append(f"{counted(measured.windows.size, 'window')} of tests that do not repeat")
    return (
        f"Baseline {diagnosis.model} with {effects}, compared with {' and '.join(compared) or '0 dwells'}; "
        f"computed in {diagnosis.wall_s:.0f} s."
    )


def closed_words(shrink: Shrink) -> tuple[str, str]:
    """What calibration closes of the gap beyond the noise, and what the effect closes of what is left of it.

    The second with its 95 % interval, where it has one.
    """
    closed, (low, high) = percentage(shrink.closed_by_effect), shrink.interval_by_effect
    if isfinite(shrink.closed_by_effect) and isfinite(low):
        closed += f" ({percentage(low)} to {percentage(high)})"
    return percentage(shrink.closed_by_calibration), closed


def gap_percentage(gap: float) -> str:
    """A relative gap in per cent, two decimals below 10 %."""
    return percentage(gap, 2 if gap < 0.1 else 1)


def probability_words(probability: float) -> str:
    """A probability in per cent; neither 0 nor 100 unless it is."""
    return "< 0.1 %" if 0.0 < probability < 0.5 * SMALL else percentage(probability)


def gain_words(gain: float) -> str:
    """A gain [nat] with its sign and three digits."""
    if not isfinite(gain) or gain == 0.0:
        return signed(gain, 2)
    return signed(gain, min(max(2 - floor(log10(abs(gain))), 0), 3))


def sigma_words(sigma: float) -> str:
    """A number of standard deviations."""
    return decimal(sigma, 1 if abs(sigma) < 100.0 else 0)


def smallest_words(each: NotJudgeable) -> str:
    """The smallest size of an effect that would have been detected, with its unit, if there is one."""
    if not isfinite(each.smallest):
        return "whatever its size"
    unit = unit_text(each.unit)
    return numeral(each.smallest, 0.1 * abs(each.smallest)) + ("" if unit == DASH else f" {unit}")


def estimate_words(each: Estimate) -> str:
    """A parameter with interval and unit."""
    unit = unit_text(each.unit)
    tail = "" if unit == DASH else f" {unit}"
    return f"{value_words(each)} ({interval_words(each)}){tail}"


def value_words(each: Estimate) -> str:
    """The value of a parameter, to the digits that its interval justifies."""
    return numeral(each.value, _error(each))


def interval_words(each: Estimate) -> str:
    """The 95 % interval of a parameter."""
    return interval(each.lo, each.hi, _error(each))


def _error(each: Estimate) -> float:
    """About a standard deviation [unit]; NaN where the interval is open."""
    return 0.25 * (each.hi - each.lo)


def p_value_words(p_value: float) -> str:
    """A p-value with two significant digits where it is small."""
    return decimal(p_value, 2 if p_value >= 0.1 else 3)


def regimes_sentence(diagnosis: Diagnosis) -> str:
    """The regimes in which the misfit is concentrated; empty where there is none."""
    found = [
        f"{each.name} ({percentage(each.gap_percent / 100.0)} of the response, p = {p_value_words(each.p_value)})"
        for each in diagnosis.regimes
        if each.p_value < LEVEL
    ]
    return f"Regimes in which the recalibrated gap is concentrated: {'; '.join(found)}." if found else ""


def motion_words(diagnosis: Diagnosis) -> str:
    """The port whose speed, stroke and direction regimes are distinguished by, in words."""
    ports = (each for each in diagnosis.given.plant.ports if each.kind is PortKind.FORCE)
    first = next(ports, None)
    return "" if first is None else port_words(diagnosis, first.location)


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
        *_regimes(diagnosis),
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
        return (name, *map(gap_percentage, gaps), *closed_words(each))

    rows = [cells("together", diagnosis.shrink)]
    rows += [
        cells(channel_label(name, diagnosis.given).title.removeprefix("sprung-mass "), each)
        for name, each in diagnosis.by_channel.items()
    ]
    if diagnosis.further is not None:
        other = diagnosis.further
        gaps = (other.before, other.recalibrated, other.after, other.floor)
        rows.append((other.name, *map(gap_percentage, gaps), DASH, DASH))
    headers = (
        "gap on held-out tests",
        "before",
        "recali-\nbrated",
        "after",
        "floor",
        "closed by\ncalibration",
        "closed by\neffect",
    )
    return table("Gap by model", headers, rows)


def _ports(diagnosis: Diagnosis) -> list[RenderableType]:
    # What is named may explain little to first order: a friction that sticks for most of the time, say.
    largest, named = diagnosis.ports[:_SHOWN_PORTS], diagnosis.verdict.ports
    beside = [each for each in diagnosis.ports[_SHOWN_PORTS:] if each.port in named]
    shown = [
        f"{port_words(diagnosis, each.port)} {percentage(each.share, 0)}" for each in (*largest, *beside)
    ]
    text = "Share of the recalibrated gap explained by a law at one port, to first order: "
    return [plain(f"{text}{', '.join(shown)}."), plain("")] if shown else []


def _regimes(diagnosis: Diagnosis) -> list[RenderableType]:
    sentence = regimes_sentence(diagnosis)
    return [plain(sentence), plain("")] if sentence else []


def _candidates(diagnosis: Diagnosis) -> RenderableType:
    every = diagnosis.candidates
    shown, _ = shown_candidates(diagnosis)
    rows = [
        (
            str(each.hypothesis),
            probability_words(each.probability),
            sigma_words(each.score_sigma),
            gain_words(each.heldout_gain),
            percentage(each.share_closed),
        )
        for each in shown
    ]
    headers = ("hypothesis", "probability", "score\n[sd]", "held-out gain\n[nat per datum]", "share\nclosed")
    title = f"Hypotheses ({len(shown)} of {len(every)})"
    return table(title, headers, rows)


def _parameters(diagnosis: Diagnosis) -> Iterator[RenderableType]:
    """Of the hypothesis that the verdict names."""
    if not diagnosis.verdict.law_known:
        return
    named = [each for each in diagnosis.candidates if each.effects == diagnosis.verdict.effects]
    estimates = named[0].parameters if named and diagnosis.verdict.effects else ()
    if estimates:
        yield plain("Its parameters, with 95 % intervals", "bold")
        yield from (plain(f"- {each.name}: {estimate_words(each)}") for each in estimates)
        yield plain("")


def _confusable(diagnosis: Diagnosis) -> list[RenderableType]:
    others = ", ".join(diagnosis.verdict.confusable_with)
    return [plain(f"This campaign cannot distinguish it from: {others}."), plain("")] if others else []


def _next_tests(diagnosis: Diagnosis) -> list[RenderableType]:
    if not diagnosis.next_tests:
        return []
    rows = [
        (each.test, " from ".join(map(str, each.separates)), decimal(each.expected_sigma, 1))
        for each in diagnosis.next_tests
    ]
    return [table("Next tests", ("test", "separates", "expected\n[sd]"), rows, texts=(0, 1))]


def _not_judgeable(diagnosis: Diagnosis) -> Iterator[RenderableType]:
    if diagnosis.not_judgeable:
        yield plain("Effects that this campaign cannot detect", "bold")
    for each in diagnosis.not_judgeable:
        size = smallest_words(each)
        limit = f"unless its {each.parameter} is at least {size}" if isfinite(each.smallest) else size
        yield plain(f"- {each.effect}, {limit}")


def _warnings(diagnosis: Diagnosis) -> Iterator[RenderableType]:
    if diagnosis.warnings:
        yield plain("")
        yield plain("Warnings", "bold")
    yield from (plain(f"- {warning}") for warning in diagnosis.warnings)
