"""The report of blind trials: one page."""

from collections.abc import Mapping, Sequence
from typing import Any

from savgs_ident.diagnose.blind.score import Score
from savgs_ident.diagnose.blind.totals import Rate, rates_of
from savgs_ident.report.blind_figure import confusion_figure
from savgs_ident.report.blind_record import PACKAGES
from savgs_ident.report.blind_words import (
    RATE_WORDS,
    change_words,
    closed_words,
    is_right,
    rate_words,
    said_words,
    summary,
    truth_words,
)
from savgs_ident.report.html import embed, render_page
from savgs_ident.report.origin import versions_of

_FACTS = ("named_right", "located_right", "false_alarms", "unknown_recognised", "both_named")


def blind_html(scores: Sequence[Score], settings: Mapping[str, Any], command: Sequence[str]) -> str:
    """The page: one file, no network, nothing executed; the same trials give the same bytes."""
    rates = rates_of(scores)
    missed = [RATE_WORDS[name].lower() for name, rate in rates.items() if rate.met is False]
    words = (
        f"Confusion matrix of {len(scores)} trials: {sum(map(is_right, scores))} on its diagonal are right."
    )
    return render_page(
        "blind.html.j2",
        {
            "sentence": summary(scores),
            "alarm": f"Not as wanted: {', '.join(missed)}." if missed else "",
            "facts": [_fact(name, rates[name]) for name in _FACTS],
            "rates": [(RATE_WORDS[name], *rate_words(rate), _met(rate)) for name, rate in rates.items()],
            "picture": embed(confusion_figure(scores), words),
            "scores": [
                (
                    str(score.number),
                    truth_words(score),
                    change_words(score),
                    said_words(score),
                    "right" if is_right(score) else "wrong",
                    closed_words(score),
                    _held(score),
                )
                for score in scores
            ],
            "settings": [(name, str(value)) for name, value in settings.items()],
            "command": " ".join(command),
            "versions": versions_of(PACKAGES),
        },
    )


def _fact(name: str, rate: Rate) -> dict[str, object]:
    count, share, _, wanted = rate_words(rate)
    return {
        "name": RATE_WORDS[name],
        "value": share,
        "then": f"{count}; wanted {wanted}",
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
