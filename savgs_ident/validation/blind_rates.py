"""What many trials say together: rates with their intervals, confusions of effects, and stated probabilities.

Stated probabilities are held against how often what was said is true, in bins, and the expected calibration error is

    sum over bins of n_b / n |mean stated probability - share that is true|.

Pure functions. Source: Guo, Pleiss, Sun, Weinberger 2017, On Calibration of Modern Neural Networks.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from savgs_ident.validation.blind_score import FAILED, Level, Score, said_right

Z = 1.959964
"""Standard deviations of a 95 % interval."""

NOTHING, TWO, OTHERS, UNKNOWN = "nothing", "both of two", "other effects", "unknown"
LEFT_ALONE = "too little to see"
"""The verdict on effects of which calibration leaves too little, that does not name them or anything instead."""


@dataclass(frozen=True)
class Rate:
    """So many of so many, and the bounds that the rate should keep [1].

    ``low`` and ``high`` are its 95 % interval after Wilson (1927); 0 and 1 if there is nothing to count.
    """

    count: int
    total: int
    least: float = 0.0
    most: float = 1.0

    @property
    def rate(self) -> float | None:
        """The rate [1]; None if there is nothing to count."""
        return self.count / self.total if self.total else None

    @property
    def met(self) -> bool | None:
        """Whether it keeps its bounds; None if it has none, or there is nothing to count.

        A rate that should be high, but not too high, is too high only if chance does not explain it: all of
        twenty intervals hold the truth often enough where 95 % should.
        """
        if self.rate is None or (self.least <= 0.0 and self.most >= 1.0):
            return None
        highest = self.low if self.least > 0.0 else self.rate
        return self.least <= self.rate and highest <= self.most

    @property
    def low(self) -> float:
        """Lower end of the interval [1]."""
        return self._ends()[0]

    @property
    def high(self) -> float:
        """Upper end of the interval [1]."""
        return self._ends()[1]

    def _ends(self) -> tuple[float, float]:
        n = self.total
        if n == 0:
            return 0.0, 1.0
        share = self.count / n
        middle = (share + Z**2 / (2 * n)) / (1.0 + Z**2 / n)
        half = Z * sqrt(share * (1.0 - share) / n + Z**2 / (4 * n**2)) / (1.0 + Z**2 / n)
        # It contains the share, but for rounding.
        return min(max(middle - half, 0.0), share), max(min(middle + half, 1.0), share)


def rates_of(scores: Sequence[Score]) -> dict[str, Rate]:
    """All rates by name, in the order in which they are reported; foreign trials have rates of their own."""
    return _foreign_rates(scores) if any(score.foreign for score in scores) else _own_rates(scores)


def _foreign_rates(scores: Sequence[Score]) -> dict[str, Rate]:
    held = [interval.holds for score in scores for interval in score.intervals.values()]
    effects = [score for score in scores if score.kind == "foreign" and not score.left_alone]
    closed = [(score.closed_by_effect or 0.0) >= 0.9 for score in effects]
    return {
        "port_right": _rate([score.port_right for score in scores], least=0.92),
        "family_right": _rate([score.family_right for score in scores], least=0.88),
        "false_alarms": _rate([score.false_alarm for score in scores], most=0.01),
        "intervals_hold": _rate(held, least=0.92, most=0.98),
        "closed_by_effect_90": _rate(closed),
        "port_exactly": _rate([score.port_exactly for score in scores]),
        "family_exactly": _rate([score.family_exactly for score in scores]),
        "port_listed": _rate([score.port_listed for score in scores]),
        "hidden_left_alone": _rate([score.left_alone for score in scores if score.hidden]),
    }


def median_closed(scores: Sequence[Score]) -> float | None:
    """Median share of the recalibrated gap that was closed, of all trials with an effect that is no hidden one.

    A gap of which the diagnosis does not say counts as not closed. None where there is no such trial.
    """
    effects = [score for score in scores if score.kind != "none" and not score.left_alone]
    closed = [score.closed_by_effect or 0.0 for score in effects]
    return float(np.median(closed)) if closed else None


def _own_rates(scores: Sequence[Score]) -> dict[str, Rate]:
    held = [interval.holds for score in scores for interval in score.intervals.values()]
    closed = [score.share_closed for score in scores if score.named_right or score.both_named]
    return {
        "named_right": _rate([score.named_right for score in scores], least=0.92),
        "located_right": _rate([score.located_right for score in scores], least=0.97),
        "false_alarms": _rate([score.false_alarm for score in scores], most=0.01),
        "unknown_recognised": _rate([score.unknown_recognised for score in scores], least=0.80),
        "both_named": _rate([score.both_named for score in scores], least=0.85),
        "intervals_hold": _rate(held, least=0.92, most=0.98),
        "share_closed_90": _rate([share is not None and share >= 0.9 for share in closed]),
        "named_exactly": _rate([score.named_exactly for score in scores]),
        "located_exactly": _rate([score.located_exactly for score in scores]),
        "hidden_left_alone": _rate([score.left_alone for score in scores if score.hidden]),
    }


def _rate(marks: Iterable[bool | None], least: float = 0.0, most: float = 1.0) -> Rate:
    counted = [mark for mark in marks if mark is not None]
    return Rate(sum(counted), len(counted), least, most)


@dataclass(frozen=True)
class Confusion:
    """Trials by what there was (rows) and what was said (columns), (r, c)."""

    truths: tuple[str, ...]
    verdicts: tuple[str, ...]
    counts: NDArray[np.int64]


def truth_of(score: Score) -> str:
    """The row of a trial."""
    words = {"none": NOTHING, "two": TWO, "unknown": UNKNOWN}
    return words.get(score.kind, "".join(score.effects[:1]))


def verdict_of(score: Score) -> str:
    """Its column: what was named, or that more was named than there is, or not the right ones.

    A foreign effect whose family is named counts as named.
    """
    if score.left_alone:
        return LEFT_ALONE
    several = TWO if score.both_named else OTHERS
    if score.kind == "foreign" and score.family_right:
        return truth_of(score)
    words = {"none": NOTHING, "several": several, "effect": "".join(score.said[:1]) or OTHERS}
    return words.get(score.verdict, score.verdict)


def confusion_of(scores: Sequence[Score], order: Sequence[str]) -> Confusion:
    """The confusion matrix, effects in the given order and then others, those that appear nowhere left out."""
    truths, verdicts = ({name_of(score) for score in scores} for name_of in (truth_of, verdict_of))
    ends = (TWO, LEFT_ALONE, OTHERS, UNKNOWN, FAILED)
    others = sorted((truths | verdicts) - {NOTHING, *ends, *order})
    effects = [*(name for name in order if name in truths | verdicts), *others]
    rows = [name for name in (NOTHING, *effects, TWO, UNKNOWN) if name in truths]
    columns = [name for name in (NOTHING, *effects, *ends) if name in truths | verdicts]
    counts = np.zeros((len(rows), len(columns)), dtype=np.int64)
    for score in scores:
        counts[rows.index(truth_of(score)), columns.index(verdict_of(score))] += 1
    return Confusion(tuple(rows), tuple(columns), counts)


EDGES = (0.0, 0.5, 0.7, 0.9, 0.99, 1.0)
"""Bins of stated probabilities; each holds its upper end."""


@dataclass(frozen=True)
class ReliabilityBin:
    """Verdicts whose stated probability lies above ``low`` and up to ``high`` [1].

    Attributes:
        low: lower end.
        high: upper end.
        stated: mean of the stated probabilities; None without a verdict.
        rate: how many of the verdicts are true, with the interval of their share.
    """

    low: float
    high: float
    stated: float | None
    rate: Rate


@dataclass(frozen=True)
class Reliability:
    """Stated probabilities against how often what was said is true; the error is None without a verdict."""

    bins: tuple[ReliabilityBin, ...]
    error: float | None


def reliability_of(scores: Sequence[Score]) -> Reliability:
    """The table of the trials that state a probability and did not fail."""
    # Diagnoses of earlier versions may state one and a rounding.
    stated = [
        (min(score.probability, EDGES[-1]), said_right(score))
        for score in scores
        if score.probability is not None and score.verdict != FAILED
    ]
    return _reliability(stated)


def reliability_by_level(scores: Sequence[Score]) -> dict[Level, Reliability]:
    """The same of what verdicts say of ports, of families and of laws, levels without a statement left out."""
    said = [each for score in scores for each in score.statements]
    found: dict[Level, list[tuple[float, bool]]] = {}
    for each in said:
        found.setdefault(each.level, []).append((min(each.probability, EDGES[-1]), each.true))
    return {level: _reliability(found[level]) for level in get_args(Level) if level in found}


def _reliability(stated: Sequence[tuple[float, bool]]) -> Reliability:
    bins = tuple(_bin(low, high, stated) for low, high in pairwise(EDGES))
    if not stated:
        return Reliability(bins, None)
    off = [
        abs(each.stated - each.rate.rate) * each.rate.total
        for each in bins
        if each.stated is not None and each.rate.rate is not None
    ]
    return Reliability(bins, sum(off) / len(stated))


def _bin(low: float, high: float, stated: Sequence[tuple[float, bool]]) -> ReliabilityBin:
    inside = [(p, true) for p, true in stated if low < p <= high or p == low == EDGES[0]]
    mean = float(np.mean([p for p, _ in inside])) if inside else None
    return ReliabilityBin(low, high, mean, Rate(sum(true for _, true in inside), len(inside)))
