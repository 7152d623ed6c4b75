"""Blind trials in the terminal: how often right, and where not."""

from collections.abc import Sequence

from rich.console import Group, RenderableType

from savgs_ident.diagnose.blind.score import Score
from savgs_ident.diagnose.blind.totals import rates_of
from savgs_ident.report.blind_words import (
    RATE_WORDS,
    change_words,
    is_right,
    rate_words,
    said_words,
    summary,
    truth_words,
)
from savgs_ident.report.terminal import plain, table


def blind_text(scores: Sequence[Score]) -> RenderableType:
    """The rates, and the trials whose verdict is not right."""
    rates = [
        (RATE_WORDS[name], *rate_words(rate), {True: "yes", False: "NO", None: ""}[rate.met])
        for name, rate in rates_of(scores).items()
    ]
    headers = ("", "trials", "rate", "95 % interval", "wanted", "met")
    wrong = [
        (score.number, truth_words(score), change_words(score), said_words(score))
        for score in scores
        if not is_right(score)
    ]
    parts: list[RenderableType] = [plain(summary(scores), "bold"), plain("")]
    parts.append(table("Blind trials", headers, rates))
    if wrong:
        heads = ("trial", "there was", "change", "the verdict")
        parts.append(table("Where it was wrong", heads, wrong, texts=(1, 3)))
    return Group(*parts)


def trial_line(score: Score) -> str:
    """A trial in a few words."""
    right = "right" if is_right(score) else "wrong"
    return f"trial {score.number}: {truth_words(score)}; said {said_words(score)}: {right}"
