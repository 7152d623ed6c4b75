"""How well a diagnosis did: its ``diagnosis.json`` against the answer. Pure functions.

An effect counts as named by its own name. Where the draw found that another effect does the same to the campaign,
so that nobody can tell which it is, naming that one counts too, if the verdict says that it cannot tell the two
apart. The port of something unknown counts as found, too, where the verdict says that it cannot tell it from the one
that it names. Marks that do not apply to a kind of trial are None.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from savgs_ident.core.records import record_of
from savgs_ident.diagnose.blind.answer import Answer, Drawn
from savgs_ident.effects.registry import CATALOGUE

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
            is none or the diagnosis does not tell.
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
