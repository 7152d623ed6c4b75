"""What blind trials say in words."""

from collections.abc import Mapping, Sequence
from math import isfinite

from savgs_ident.diagnose.blind.score import FAILED, Score
from savgs_ident.diagnose.blind.totals import Rate
from savgs_ident.report.numerals import DASH, percentage

RATE_WORDS: Mapping[str, str] = {
    "named_right": "Effect named right",
    "located_right": "Located right",
    "false_alarms": "False alarms where nothing is missing",
    "unknown_recognised": "Unknown effect recognised as unknown",
    "both_named": "Both of two effects named",
    "intervals_hold": "95 % intervals that hold the truth",
    "share_closed_90": "Nine tenths of the gap closed, where all is named",
    "named_exactly": "Effect named, and not one that does the same",
    "located_exactly": "Located, and at no port that explains it as well",
}
"""What each rate counts."""

_KIND_WORDS = {"none": "nothing", "unknown": "unknown", FAILED: "failed"}


def rate_words(rate: Rate) -> tuple[str, str, str, str]:
    """A rate as count, share, interval, and what is wanted."""
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


def truth_words(score: Score) -> str:
    """What there was."""
    names = " + ".join(score.effects)
    return {"none": "nothing", "unknown": f"{names} (not in the catalogue)"}.get(score.kind, names)


def change_words(score: Score) -> str:
    """By how much it changes the response."""
    return " + ".join(percentage(change) for change in score.changes) or DASH


def said_words(score: Score) -> str:
    """What the verdict said."""
    return _KIND_WORDS.get(score.verdict, " + ".join(score.said))


def is_right(score: Score) -> bool:
    """Whether the verdict is right altogether."""
    marks = (score.named_right, score.unknown_recognised, score.both_named)
    return any(marks) or (score.kind == "none" and score.verdict == "none")


def closed_words(score: Score) -> str:
    """The share of the gap that was closed."""
    share = score.share_closed
    return DASH if share is None or not isfinite(share) or score.verdict == "none" else percentage(share)


def summary(scores: Sequence[Score]) -> str:
    """All trials in one sentence."""
    right = sum(map(is_right, scores))
    return f"The diagnosis was right in {right} of {len(scores)} campaigns whose effect it was not told of."
