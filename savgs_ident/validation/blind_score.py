"""What the marks of a blind trial are: a record, in words, read back from a file.

How a diagnosis is marked is in :mod:`savgs_ident.validation.blind_marks`, what many trials say together in
:mod:`savgs_ident.validation.blind_rates`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from savgs_ident.core.files import record_of
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.blind_answer import Drawn
from savgs_ident.validation.foreign_laws import FOREIGN

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


Level = Literal["port", "family", "law"]
"""Levels of the tree of hypotheses: where something acts, of which kind it is there, by which formula."""


@dataclass(frozen=True)
class Statement:
    """Something that a verdict says on one level: with which probability [1], and whether it is true."""

    level: Level
    what: str
    probability: float
    true: bool


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
        unknown_recognised: the verdict is unknown, or a law that the catalogue does not have; of trials whose effect
            is not in the catalogue.
        both_named: both drawn effects and no other are named; of trials with two.
        share_closed: share of the explainable gap that the diagnosis closed, on tests held out; None if there
            is none or the diagnosis does not say.
        intervals: of the effects' parameters, where the verdict names all of them and no other; in a foreign trial,
            of those of the rig's own that mean something.
        wall_s: how long the diagnosis took [s].
        foreign: whether it is a foreign trial.
        families: what the verdict says is missing, each as port/family.
        sigmas: by how many standard deviations each effect stands out, in the order of ``effects``.
        port_right: something is named or unknown, at ports that are right alone, or at one where the law itself does
            the same, which the verdict says; of foreign trials with an effect.
        port_exactly: the same, at ports that are right alone; of the same.
        port_listed: the ports are right, or a right one is listed as indistinguishable from them; of the same.
        family_right: a family is named, with ports that are right as above and families that are; of the same.
        family_exactly: the same, at ports that are right alone; of the same.
        elsewhere: log odds [nat] of the drawn law itself at its own port against it at the port that is named, or
            against the effect that is named instead of it; None where that was not looked at.
        probability: that the verdict states; None if it states none.
        closed_by_effect: share of the recalibrated gap that what is named closes, on tests held out; None as above.
        version: of the code that made the diagnosis.
        hidden: whether calibration leaves too little of a foreign effect, or of every effect that is not named, in
            the draw or in held-out tests.
        meant: the drawn effects that the verdict names, or the one that it says it cannot distinguish from what it
            names in its place, which does the same; of trials of the catalogue.
        law_known: whether what is named is a formula of the catalogue; if not, ``said`` is the nearest one.
        imitated: whether, instead of an effect that was removed, one is named that does the same.
        statements: what the verdict says of ports, families and laws; what does the same is not true there.
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
    foreign: bool = False
    families: tuple[str, ...] = ()
    sigmas: tuple[float, ...] = ()
    port_right: bool | None = None
    port_exactly: bool | None = None
    port_listed: bool | None = None
    family_right: bool | None = None
    family_exactly: bool | None = None
    elsewhere: float | None = None
    probability: float | None = None
    closed_by_effect: float | None = None
    version: str = ""
    hidden: bool = False
    meant: tuple[str, ...] = ()
    law_known: bool = True
    imitated: bool = False
    statements: tuple[Statement, ...] = ()

    @property
    def left_alone(self) -> bool:
        """Whether an effect that calibration hides is not named, and no other instead of it."""
        one_of_two = (
            self.kind == "two" and self.verdict == "effect" and len(self.said) == len(self.meant) == 1
        )
        return self.hidden and (self.verdict == "none" or (one_of_two and self.law_known))

    def __str__(self) -> str:
        right = "right" if is_right(self) else "wrong"
        return f"trial {self.number}: {truth_words(self)}; verdict {said_words(self)}: {right}"


_KIND_WORDS = {"none": "nothing", "unknown": "unknown", FAILED: "failed"}


def truth_words(score: Score) -> str:
    """The effects that were in the rig."""
    names = " + ".join(score.effects)
    foreign = f"{names} (foreign law)"
    return {"none": "nothing", "unknown": f"{names} (not in the catalogue)", "foreign": foreign}.get(
        score.kind, names
    )


def said_words(score: Score) -> str:
    """The verdict as names of effects, and the families where no formula of the catalogue is said to be right."""
    names = " + ".join(score.said)
    learned = score.verdict == "effect" and not score.law_known
    if learned:
        said = f"another law, nearest to {names}" if names else "another law"
    else:
        said = _KIND_WORDS.get(score.verdict, names)
    return f"{said} ({', '.join(score.families)})" if (score.foreign or learned) and score.families else said


def is_right(score: Score) -> bool:
    """Whether the verdict is right altogether."""
    marks = (score.named_right, score.unknown_recognised, score.both_named, score.family_right)
    return (
        any(marks) or score.left_alone or score.imitated or (score.kind == "none" and score.verdict == "none")
    )


def said_right(score: Score) -> bool:
    """Whether what the verdict says is true: what its stated probability is to be compared with.

    That a foreign effect is unknown, at its port, is true; that it is at a port where it would do the same is not. An
    effect that does the same as the drawn one is not there, however right it is to name it. A law of something that
    was removed from the catalogue is true at its port alone.
    """
    if score.kind in ("effect", "two"):
        hidden = {*score.effects} - {*score.meant} if score.left_alone else set()
        return score.law_known and {*score.said} == {*score.effects} - hidden
    if score.family_right:
        return score.family_exactly is True
    if score.kind == "unknown" and score.verdict == "effect":
        return score.unknown_recognised is True and score.located_exactly is True
    return is_right(score) or (score.verdict == "unknown" and score.port_exactly is True)


def score_from(record: object, catalogue: Iterable[str] = CATALOGUE) -> Score:
    """The marks that ``dataclasses.asdict`` and JSON made ``record`` of; ``ValueError`` for others.

    ``catalogue`` has the effects that a diagnosis can name.
    """
    if isinstance(record, Mapping):
        # Marks of versions that did not look at other ports are strict.
        strict = {"port_exactly": record.get("port_right"), "family_exactly": record.get("family_right")}
        strict["meant"] = [name for name in record.get("said", ()) if name in record.get("effects", ())]
        record = {**strict, **record}
    score = record_of(Score, record)
    named = {*catalogue}
    known = named | {*FOREIGN} if score.kind == "foreign" else named
    if score.verdict not in _VERDICTS or not ({*score.effects} <= known and {*score.said} <= named):
        raise ValueError(f"trial {score.number} is about something unknown")
    if (score.kind in ("effect", "foreign") and len(score.effects) != 1) or (
        score.verdict == "effect" and not (score.said or score.families)
    ):
        raise ValueError(f"trial {score.number} names no effect")
    return score
