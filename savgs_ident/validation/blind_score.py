"""How well a diagnosis did: its ``diagnosis.json`` against the answer. Pure functions.

An effect counts as named by its own name. Where the draw found that another effect does the same to the campaign,
so that nothing shows which it is, naming that one counts too, if the verdict says that it cannot distinguish the two.
The port of something unknown counts as found, too, where the verdict says that it cannot distinguish it from the one
that it names. Marks that do not apply to a kind of trial are None.

What many trials say together: rates with their intervals, and who is taken for whom. Pure functions.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.files import record_of
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.blind_record import Answer, Drawn

FAILED = "failed"
"""The verdict of a diagnosis that ended with an error."""

_VERDICTS = ("none", "effect", "several", "unknown", FAILED)


@dataclass(frozen=True)
class Interval:
    """True value of an effect's parameter, and the 95 % interval that the diagnosis gave, SI."""

    true: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the truth lies inside."""
        return self.low <= self.true <= self.high


@dataclass(frozen=True)
class Score:
    """A trial's marks.

    Attributes:
        number: of the trial.
        kind: what was drawn.
        effects: names of the drawn effects.
        changes: by how much each changes the response, relative, in the same order.
        verdict: kind of the verdict: none, effect, several, unknown, or :data:`FAILED`.
        said: names of the effects that the verdict names.
        named_right: the drawn effect and no other is named, or one that does the same and is said to; of trials
            with one effect.
        named_exactly: the drawn effect and no other is named; of the same.
        located_right: the verdict's ports are those of the drawn effects, or of what does the same and is said to;
            of trials with any effect.
        located_exactly: the verdict's ports are those of the drawn effects; of the same.
        false_alarm: something is named, or said to be unknown; of trials with nothing.
        unknown_recognised: the verdict is unknown; of trials whose effect is not in the catalogue.
        both_named: both drawn effects and no other are named; of trials with two.
        share_closed: share of the explainable gap that the diagnosis closed, on tests held out; None if there
            is none or the diagnosis does not say.
        intervals: of the effects' parameters, where the verdict names all of them and no other.
        wall_s: how long the diagnosis took [s].
    """

    number: int
    kind: Drawn
    effects: tuple[str, ...]
    changes: tuple[float, ...]
    verdict: str
    said: tuple[str, ...]
    named_right: bool | None
    named_exactly: bool | None
    located_right: bool | None
    located_exactly: bool | None
    false_alarm: bool | None
    unknown_recognised: bool | None
    both_named: bool | None
    share_closed: float | None
    intervals: Mapping[str, Interval]
    wall_s: float

    def __str__(self) -> str:
        right = "right" if is_right(self) else "wrong"
        return f"trial {self.number}: {truth_words(self)}; verdict {said_words(self)}: {right}"


_KIND_WORDS = {"none": "nothing", "unknown": "unknown", FAILED: "failed"}


def truth_words(score: Score) -> str:
    """The effects that were in the rig."""
    names = " + ".join(score.effects)
    return {"none": "nothing", "unknown": f"{names} (not in the catalogue)"}.get(score.kind, names)


def said_words(score: Score) -> str:
    """The verdict as names of effects."""
    return _KIND_WORDS.get(score.verdict, " + ".join(score.said))


def is_right(score: Score) -> bool:
    """Whether the verdict is right altogether."""
    marks = (score.named_right, score.unknown_recognised, score.both_named)
    return any(marks) or (score.kind == "none" and score.verdict == "none")


def score_of(answer: Answer, diagnosis: Mapping[str, Any]) -> Score:
    """The marks of a diagnosis, given as the object of its ``diagnosis.json``."""
    verdict = diagnosis["verdict"]
    said, true = tuple(verdict["effects"]), set(answer.effects)
    right = set(said) == true and len(said) == len(true)
    alike = len(said) == 1 and said[0] in answer.imitators and true <= {*verdict["confusable_with"]}
    here = set(verdict["ports"]) == set(answer.ports) and verdict["kind"] != "none"
    beside = verdict["kind"] == "unknown" and set(answer.ports) <= {*verdict["confusable_ports"]}
    kind = answer.kind
    return Score(
        number=answer.number,
        kind=kind,
        effects=answer.effects,
        changes=tuple(answer.changes[name] for name in answer.effects),
        verdict=verdict["kind"],
        said=said,
        named_right=right or alike if kind == "effect" else None,
        named_exactly=right if kind == "effect" else None,
        located_right=here or alike or beside if kind != "none" else None,
        located_exactly=here if kind != "none" else None,
        false_alarm=verdict["kind"] not in ("none", FAILED) if kind == "none" else None,
        unknown_recognised=verdict["kind"] == "unknown" if kind == "unknown" else None,
        both_named=right if kind == "two" else None,
        share_closed=diagnosis["shrink"]["share_closed"],
        intervals=_intervals(answer, diagnosis) if right else {},
        wall_s=float(diagnosis["wall_s"]),
    )


def score_from(record: Mapping[str, Any]) -> Score:
    """The marks that ``dataclasses.asdict`` and JSON made ``record`` of; ``ValueError`` for others."""
    score = record_of(Score, record)
    if score.verdict not in _VERDICTS or not {*score.effects, *score.said} <= {*CATALOGUE}:
        raise ValueError(f"trial {score.number} is about something unknown")
    if (score.kind == "effect" and len(score.effects) != 1) or (score.verdict == "effect" and not score.said):
        raise ValueError(f"trial {score.number} names no effect")
    return score


def failed(why: str) -> dict[str, Any]:
    """What stands for the ``diagnosis.json`` of a diagnosis that ended with an error."""
    verdict = {
        "kind": FAILED,
        "effects": [],
        "ports": [],
        "confusable_with": [],
        "sentence": why,
        "confusable_ports": [],
    }
    return {"verdict": verdict, "which": [], "shrink": {"share_closed": None}, "wall_s": 0.0}


def _intervals(answer: Answer, diagnosis: Mapping[str, Any]) -> dict[str, Interval]:
    """Intervals that the verdict's hypothesis gives for parameters that the rig truly has."""
    said = sorted(diagnosis["verdict"]["effects"])
    for each in diagnosis["which"]:
        if sorted(each["effects"]) == said:
            return {
                name: Interval(answer.parameters[name], found["lo"], found["hi"])
                for name, found in each["parameters"].items()
                if name in answer.parameters and None not in (found["lo"], found["hi"])
            }
    return {}


Z = 1.959964
"""Standard deviations of a 95 % interval."""

NOTHING, TWO, OTHERS, UNKNOWN = "nothing", "both of two", "other effects", "unknown"


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
        return max(middle - half, 0.0), min(middle + half, 1.0)


def rates_of(scores: Sequence[Score]) -> dict[str, Rate]:
    """All rates by name, in the order in which they are reported."""
    held = [interval.holds for score in scores for interval in score.intervals.values()]
    closed = [score.share_closed for score in scores if score.named_right or score.both_named]
    return {
        "named_right": _rate([score.named_right for score in scores], least=0.90),
        "located_right": _rate([score.located_right for score in scores], least=0.95),
        "false_alarms": _rate([score.false_alarm for score in scores], most=0.02),
        "unknown_recognised": _rate([score.unknown_recognised for score in scores], least=0.80),
        "both_named": _rate([score.both_named for score in scores], least=0.70),
        "intervals_hold": _rate(held, least=0.90, most=0.99),
        "share_closed_90": _rate([share is not None and share >= 0.9 for share in closed]),
        "named_exactly": _rate([score.named_exactly for score in scores]),
        "located_exactly": _rate([score.located_exactly for score in scores]),
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
    return {"none": NOTHING, "two": TWO, "unknown": UNKNOWN, "effect": "".join(score.effects[:1])}[score.kind]


def verdict_of(score: Score) -> str:
    """Its column: what was named, or that more was named than there is, or not the right ones."""
    several = TWO if score.both_named else OTHERS
    words = {"none": NOTHING, "several": several, "effect": "".join(score.said[:1])}
    return words.get(score.verdict, score.verdict)


def confusion_of(scores: Sequence[Score], order: Sequence[str]) -> Confusion:
    """The confusion matrix, effects in the given order, those that appear nowhere left out."""
    truths, verdicts = ({name_of(score) for score in scores} for name_of in (truth_of, verdict_of))
    effects = [name for name in order if name in truths | verdicts]
    rows = [name for name in (NOTHING, *effects, TWO, UNKNOWN) if name in truths]
    ends = (TWO, OTHERS, UNKNOWN, FAILED)
    columns = [name for name in (NOTHING, *effects, *ends) if name in truths | verdicts]
    counts = np.zeros((len(rows), len(columns)), dtype=np.int64)
    for score in scores:
        counts[rows.index(truth_of(score)), columns.index(verdict_of(score))] += 1
    return Confusion(tuple(rows), tuple(columns), counts)
