"""Reports of blind trials: JSON object, sentences, tables, figures and a page."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.core.presentation import package_versions
from savgs_ident.report.blind_figures import LEVEL_WORDS, confusion_figure, reliability_figure
from savgs_ident.report.html import embed, render_page
from savgs_ident.report.text import DASH, decimal, percentage, plain, table
from savgs_ident.validation.blind_rates import (
    Rate,
    Reliability,
    confusion_of,
    median_closed,
    rates_of,
    reliability_by_level,
    reliability_of,
)
from savgs_ident.validation.blind_score import Score, is_right, said_words, truth_words
from savgs_ident.validation.foreign_laws import TRIAL_EFFECTS
from savgs_ident.validation.varied_constants import MovedMarks

RATE_WORDS: Mapping[str, str] = {
    "named_right": "Effect named correctly",
    "located_right": "Located correctly",
    "false_alarms": "False alarms where nothing is missing",
    "unknown_recognised": "Unknown effect recognised as unknown",
    "both_named": "Both of two effects named",
    "intervals_hold": "95 % intervals that contain the truth",
    "share_closed_90": "Nine tenths of the gap closed, where all effects are named",
    "named_exactly": "Effect named strictly, without indistinguishable ones",
    "located_exactly": "Located strictly, without indistinguishable ports",
    "port_right": "Foreign effect put at a right port",
    "port_exactly": "Port right strictly, without ports where the law itself would do the same",
    "port_listed": "A right port named, or listed as not distinguishable",
    "family_exactly": "Family right strictly, without ports where the law itself would do the same",
    "family_right": "Foreign effect given a right family",
    "hidden_left_alone": "Nothing named where calibration leaves too little of an effect to be seen",
    "closed_by_effect_90": "Nine tenths of the recalibrated gap closed",
}
"""What each rate counts."""


def rate_words(rate: Rate) -> tuple[str, str, str, str]:
    """A rate as count, share, interval and required bound."""
    if rate.rate is None:
        return ("0 of 0", DASH, DASH, wanted_words(rate))
    ends = f"{percentage(rate.low, 0)} to {percentage(rate.high, 0)}"
    return (f"{rate.count} of {rate.total}", percentage(rate.rate), ends, wanted_words(rate))


def wanted_words(rate: Rate) -> str:
    """The bounds that a rate should keep."""
    if rate.least > 0.0 and rate.most < 1.0:
        return f"{percentage(rate.least, 0)} to {percentage(rate.most, 0)}"
    if rate.least > 0.0:
        return f"at least {percentage(rate.least, 0)}"
    return f"at most {percentage(rate.most, 0)}" if rate.most < 1.0 else DASH


def change_words(score: Score) -> str:
    """By how much it changes the response."""
    return " + ".join(percentage(change) for change in score.changes) or DASH


def closed_words(score: Score) -> str:
    """The share of the gap that was closed; of a foreign trial, by what was named alone."""
    share = score.closed_by_effect if score.foreign else score.share_closed
    return DASH if share is None or not isfinite(share) or score.verdict == "none" else percentage(share)


def summary(scores: Sequence[Score]) -> str:
    """All trials in one sentence."""
    right = sum(map(is_right, scores))
    return f"The diagnosis was right in {right} of {len(scores)} blind campaigns."


def blind_text(scores: Sequence[Score]) -> RenderableType:
    """The rates, and the trials whose verdict is not right."""
    rates = [
        (RATE_WORDS[name], *rate_words(rate), {True: "yes", False: "NO", None: ""}[rate.met])
        for name, rate in rates_of(scores).items()
    ]
    headers = ("", "trials", "rate", "95 % interval", "required", "met")
    wrong = [
        (score.number, truth_words(score), change_words(score), said_words(score))
        for score in scores
        if not is_right(score)
    ]
    parts: list[RenderableType] = [plain(summary(scores), "bold"), plain("")]
    parts.append(table("Blind trials", headers, rates))
    parts += [plain(""), _reliability_text(scores)]
    if wrong:
        heads = ("trial", "truth", "change", "verdict")
        parts.append(table("Wrong verdicts", heads, wrong, texts=(1, 3)))
    return Group(*parts)


def probability_words(probability: float | None) -> str:
    """A stated probability in per cent."""
    return DASH if probability is None else percentage(probability)


def error_words(scores: Sequence[Score]) -> str:
    """The expected calibration error in a sentence, and that on each level of what is said."""
    whole, levels = reliability_of(scores).error, reliability_by_level(scores)
    if whole is None:
        return "No verdict states a probability."
    each = [
        f"of {LEVEL_WORDS[level]} {decimal(found.error, 3)}"
        for level, found in levels.items()
        if found.error is not None
    ]
    start = f"Expected calibration error of the stated probabilities: {decimal(whole, 3)}"
    return f"{start}; {', '.join(each)}." if each else f"{start}."


def reliability_rows(reliability: Reliability) -> list[tuple[str, str, str, str, str]]:
    """Bins as stated probabilities, their mean, verdicts, share that is true, and its interval."""
    return [
        (
            f"{decimal(each.low, 2)} to {decimal(each.high, 2)}",
            probability_words(each.stated),
            *rate_words(each.rate)[:3],
        )
        for each in reliability.bins
    ]


RELIABILITY_HEADS = ("stated probability", "mean", "true", "share", "95 % interval")


def _reliability_text(scores: Sequence[Score]) -> RenderableType:
    rows = reliability_rows(reliability_of(scores))
    return Group(
        table("Stated probabilities", RELIABILITY_HEADS, rows, texts=(0,)), plain(error_words(scores))
    )


PACKAGES = ("jax", "numpy", "scipy")


def blind_record(
    scores: Sequence[Score],
    settings: Mapping[str, Any],
    command: Sequence[str],
    moved: Sequence[MovedMarks] = (),
) -> dict[str, Any]:
    """Rates with their 95 % intervals (Wilson) and bounds, the confusion matrix, and the marks of every trial.

    ``trusted`` says that every rate keeps its bounds. Shares and changes are relative, parameters in SI.
    """
    rates, confusion = rates_of(scores), confusion_of(scores, TRIAL_EFFECTS)
    return {
        "schema": 1,
        "trusted": all(rate.met is not False for rate in rates.values()),
        "trials": len(scores),
        "kinds": {
            kind: sum(score.kind == kind for score in scores)
            for kind in ("none", "effect", "two", "unknown", "foreign")
        },
        "median_closed_by_effect": median_closed(scores),
        "reliability": _reliability(reliability_of(scores)),
        "reliability_by_level": {
            level: _reliability(each) for level, each in reliability_by_level(scores).items()
        },
        "code": sorted({score.version for score in scores} - {""}),
        "rates": {name: _rate(rate) for name, rate in rates.items()},
        "confusion": {
            "truths": confusion.truths,
            "verdicts": confusion.verdicts,
            "counts": confusion.counts,
        },
        "sensitivity": [
            asdict(each) | {"rates": {name: _rate(rate) for name, rate in each.rates.items()}}
            for each in moved
        ],
        "settings": dict(settings),
        "scores": [
            asdict(score)
            | {"intervals": {name: asdict(i) | {"holds": i.holds} for name, i in score.intervals.items()}}
            for score in scores
        ],
        "command": " ".join(command),
        "versions": package_versions(PACKAGES),
    }


def _reliability(reliability: Reliability) -> dict[str, Any]:
    bins = [
        {
            "low": each.low,
            "high": each.high,
            "stated": each.stated,
            "true": each.rate.count,
            "of": each.rate.total,
            "share": each.rate.rate,
            "interval": [each.rate.low, each.rate.high],
        }
        for each in reliability.bins
    ]
    return {"bins": bins, "calibration_error": reliability.error}


def _rate(rate: Rate) -> dict[str, Any]:
    return {
        "count": rate.count,
        "of": rate.total,
        "rate": rate.rate,
        "interval": [rate.low, rate.high],
        "least": rate.least,
        "most": rate.most,
        "met": rate.met,
    }


_FACTS = ("named_right", "located_right", "false_alarms", "unknown_recognised", "both_named")
_FOREIGN_FACTS = ("port_right", "family_right", "false_alarms", "intervals_hold")


_OWN_RIGS = (
    "Rigs drawn at random within their tolerances, with effects that change the response by 3 to 25 %; campaigns"
    " simulated in time, with noise; the answers were opened after the diagnosis."
)
_FOREIGN_RIGS = (
    "Rigs drawn at random within their tolerances, each with small errors, most with an effect by a law that the"
    " diagnosis does not have and that changes the response by 3 to 25 %; campaigns simulated in time with another"
    " method, with coloured noise, filters and converters; the answers were opened after the diagnosis."
)
_LIKE_RIGS = (
    "Campaigns like the recorded one: its tests, its noise and small errors, parameters within what it leaves open,"
    " with effects that change the response by 3 to 25 %. Truth and diagnosis have the equations of the plant in"
    " common."
)
_OWN_NOTE = (
    "Wilson intervals. Located: the ports of the verdict are those at which the effects act. The rates with"
    " “strictly” do not count effects and ports that the verdict lists as indistinguishable from the ones named."
)
_FOREIGN_NOTE = (
    "Wilson intervals. A port is right where an engineer would rightly put the effect, a family where it would"
    " rightly be called that. “Unknown” at a right port has the port, not the family. Where the drawn law itself,"
    " fitted at the named port, explains the recordings as well as at its own, no diagnosis can distinguish the two:"
    " naming it is right if the verdict says so. The rates with “strictly” do not count that."
)


def blind_html(
    scores: Sequence[Score],
    settings: Mapping[str, Any],
    command: Sequence[str],
    moved: Sequence[MovedMarks] = (),
) -> str:
    """The page: one file, no network, nothing executed; the same trials give the same bytes."""
    rates, reliability, median = rates_of(scores), reliability_of(scores), median_closed(scores)
    foreign = any(score.foreign for score in scores)
    facts = _FOREIGN_FACTS if foreign else _FACTS
    missed = [RATE_WORDS[name].lower() for name, rate in rates.items() if rate.met is False]
    words = (
        f"Confusion matrix of {len(scores)} trials: {sum(map(is_right, scores))} on its diagonal are right."
    )
    return render_page(
        "blind.html.j2",
        {
            "sentence": summary(scores),
            "alarm": f"Required rate missed: {', '.join(missed)}." if missed else "",
            "facts": [_fact(name, rates[name]) for name in facts],
            "about": _about(foreign, settings),
            "note": _FOREIGN_NOTE if foreign else _OWN_NOTE,
            "median": f"Median share of the recalibrated gap that is closed: {percentage(median)}."
            if foreign and median is not None
            else "",
            "reliability": reliability_rows(reliability),
            "reliability_heads": [head.capitalize() for head in RELIABILITY_HEADS],
            "reliability_words": error_words(scores),
            "reliability_picture": embed(reliability_figure(scores), error_words(scores)),
            "rates": [(RATE_WORDS[name], *rate_words(rate), _met(rate)) for name, rate in rates.items()],
            "moved_heads": ["Constant", "Value", "Verdicts changed", *(RATE_WORDS[name] for name in facts)],
            "moved": [_moved_row(each, facts) for each in moved],
            "picture": embed(confusion_figure(scores), words),
            "scores": [
                (
                    str(score.number),
                    truth_words(score),
                    change_words(score),
                    said_words(score),
                    "right" if is_right(score) else "wrong",
                    probability_words(score.probability),
                    closed_words(score),
                    _held(score),
                    score.version,
                )
                for score in scores
            ],
            "settings": [(name, str(value)) for name, value in settings.items()],
            "command": " ".join(command),
            "versions": package_versions(PACKAGES),
        },
    )


def _about(foreign: bool, settings: Mapping[str, Any]) -> str:
    """What the trials are."""
    if "campaign" in settings:
        return _LIKE_RIGS
    return _FOREIGN_RIGS if foreign else _OWN_RIGS


def _moved_row(moved: MovedMarks, names: Sequence[str]) -> tuple[str, ...]:
    """A constant, its other value, the verdicts that change, and rates."""
    counts = (f"{moved.rates[name].count} of {moved.rates[name].total}" for name in names)
    return (moved.constant, f"{moved.value:g}", f"{moved.changed} of {moved.trials}", *counts)


def _fact(name: str, rate: Rate) -> dict[str, object]:
    count, share, _, wanted = rate_words(rate)
    return {
        "name": RATE_WORDS[name],
        "value": share,
        "then": f"{count}; required {wanted}",
        "bad": rate.met is False,
    }


def _met(rate: Rate) -> str:
    return {True: "yes", False: "no", None: ""}[rate.met]


def _held(score: Score) -> str:
    """How many of the intervals hold the truth."""
    if not score.intervals:
        return ""
    held = sum(interval.holds for interval in score.intervals.values())
    return f"{held} of {len(score.intervals)}"
