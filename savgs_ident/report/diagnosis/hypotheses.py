"""The hypotheses of a diagnosis: a row each, and a tree of nested bars: where, what kind of thing, which law.

    rail                 98.2 %   ====================
      friction           98.2 %   ====================
        rail_stribeck    75.1 %   ===============
        learned law      23.1 %                  =====
    nothing missing       1.7 %   =

A hypothesis has one branch at every port where it acts; two effects at one port are one branch there. So the
branches of a port exclude each other and add up to its probability, and so do those of a family; a pair of effects
that acts at two ports counts at both. The bars of branches lie side by side below that of what they add up to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import fsum
from typing import NamedTuple

from savgs_ident.diagnosis.result import NONE, UNKNOWN, Candidate, Diagnosis, Hypothesis, Verdict
from savgs_ident.effects.base import Family
from savgs_ident.effects.effect import Effect
from savgs_ident.report.diagnosis.text import (
    SMALL,
    about_candidate,
    estimate_words,
    gain_words,
    port_words,
    probability_words,
    sigma_words,
)
from savgs_ident.report.text import percentage


@dataclass(frozen=True)
class CandidateRow:
    """A hypothesis; ``parameters`` are pairs of name and value with interval."""

    name: str
    about: str
    named: bool
    probability: str
    score: str
    gain: str
    closed: str
    evaluated: str
    parameters: tuple[tuple[str, str], ...]


def candidate_row(each: Candidate, diagnosis: Diagnosis) -> CandidateRow:
    """One line of the table of hypotheses."""
    return CandidateRow(
        name=str(each.hypothesis),
        about=about_candidate(diagnosis, each),
        named=bool(each.ports) and each.hypothesis in named_hypotheses(diagnosis.verdict),
        probability=probability_words(each.probability),
        score=sigma_words(each.score_sigma),
        gain=gain_words(each.heldout_gain),
        closed=percentage(each.share_closed),
        evaluated="full fit" if each.refitted else "score only",
        parameters=tuple((estimate.name, estimate_words(estimate)) for estimate in each.parameters),
    )


class Action(NamedTuple):
    """What a hypothesis does at one port: its family and its law, both joined by plus signs if there are two.

    The law is empty where it is a learned one.
    """

    port: str
    family: str
    law: str


@dataclass(frozen=True)
class Branch:
    """A port, a family there, or a law of that family.

    Attributes:
        name: of the port, the family or the law; empty for a learned law.
        probability: of all hypotheses that are part of it; the sum of its branches where it has some.
        named: whether the verdict names it.
        branches: families of a port or laws of a family, the most probable first.
    """

    name: str
    probability: float
    named: bool
    branches: tuple["Branch", ...] = ()


@dataclass(frozen=True)
class NestedBar:
    """A branch as a page draws it.

    Attributes:
        words: what it is; empty for what has a name in files alone.
        code: its name in files; empty where it has none, or where that is what the words say.
        probability: in words.
        start: where its bar begins [% of the width].
        length: of its bar [% of the width].
        named: whether the verdict names it.
        parts: the bars of its branches.
    """

    words: str
    code: str
    probability: str
    start: float
    length: float
    named: bool
    parts: tuple["NestedBar", ...] = ()


def actions_of(candidate: Candidate, catalogue: Mapping[str, Effect]) -> tuple[Action, ...]:
    """What a hypothesis does at each of its ports; nothing where nothing or something unknown is missing.

    An effect that the ``catalogue`` lacks acts wherever its hypothesis does.
    """
    learned = candidate.hypothesis.flexible
    if learned:
        return (Action(learned.port, learned.family.value, ""),)
    names = sorted(candidate.effects)
    if not all(name in catalogue for name in names):
        families = " + ".join(sorted(candidate.families))
        return tuple(Action(port, families, " + ".join(names)) for port in candidate.ports)
    there: dict[str, list[str]] = {}
    for name in names:
        there.setdefault(catalogue[name].port.location, []).append(name)
    return tuple(
        Action(
            port, " + ".join(sorted({catalogue[name].law.family.value for name in laws})), " + ".join(laws)
        )
        for port, laws in there.items()
    )


def hypothesis_tree(diagnosis: Diagnosis) -> tuple[Branch, ...]:
    """The ports at which a hypothesis acts, and those that the verdict names, the most probable first."""
    catalogue, named = diagnosis.given.catalogue, named_hypotheses(diagnosis.verdict)
    leaves = [
        _Leaf(action, each.probability, each.hypothesis in named)
        for each in diagnosis.candidates
        for action in actions_of(each, catalogue)
    ]
    grown, said = _grown(leaves), dict.fromkeys(diagnosis.verdict.ports)
    known = {each.name for each in grown}
    return (
        *(replace(each, named=each.named or each.name in said) for each in grown),
        *(Branch(port, 0.0, named=True) for port in said if port not in known),
    )


def named_hypotheses(verdict: Verdict) -> set[Hypothesis]:
    """The hypotheses that the verdict stands for."""
    if verdict.kind in ("none", "unknown"):
        return {NONE if verdict.kind == "none" else UNKNOWN}
    if verdict.law_known:
        return {Hypothesis(verdict.effects)}
    return {Hypothesis(flexible=family) for family in verdict.families}


class _Leaf(NamedTuple):
    """What a hypothesis does at a port, with its probability, and whether the verdict stands for it."""

    action: Action
    probability: float
    named: bool


def _grown(leaves: Sequence[_Leaf], level: int = 0) -> tuple[Branch, ...]:
    """The branches of a level (port, family, law), the most probable first, each with what it divides into."""
    if level == len(Action._fields):
        return ()
    groups: dict[str, list[_Leaf]] = {}
    for leaf in leaves:
        groups.setdefault(leaf.action[level], []).append(leaf)
    branches = [
        Branch(
            name=name,
            probability=fsum(leaf.probability for leaf in group),
            named=any(leaf.named for leaf in group),
            branches=_grown(group, level + 1),
        )
        for name, group in groups.items()
    ]
    return tuple(sorted(branches, key=lambda each: -each.probability))


_FAMILY_WORDS = {Family.NUMBER.value: "number of the sheet"}
"""Families whose names say too little."""

_PART = 0.01
"""Families and laws that are less probable have no bar of their own."""


def nested_bars(diagnosis: Diagnosis) -> tuple[NestedBar, ...]:
    """The bars of ports, of nothing missing and of what no family explains, the most probable first.

    Ports that are less probable than 0.1 % and not named are one bar together. So are families and laws below 1 %,
    where they have as much together; otherwise they are left out.
    """
    ports, named = hypothesis_tree(diagnosis), named_hypotheses(diagnosis.verdict)
    known = {each.hypothesis: each.probability for each in diagnosis.candidates}
    bars = [_port(each, port_words(diagnosis, each.name)) for each in ports if _shown(each, SMALL)]
    for hypothesis, words in ((NONE, "nothing missing"), (UNKNOWN, "what no family explains")):
        whole = Branch(str(hypothesis), known.get(hypothesis, 0.0), hypothesis in named)
        bars.append(_bar(words, whole, 0.0, code=whole.name))
    bars.sort(key=lambda bar: -bar.length)
    hidden = {each.name for each in ports if not _shown(each, SMALL)}
    if hidden:
        bars.append(_rest(("port", "ports"), len(hidden), _somewhere(diagnosis, hidden), 0.0))
    return tuple(bars)


def _shown(branch: Branch, least: float = _PART) -> bool:
    return branch.named or branch.probability >= least


def _somewhere(diagnosis: Diagnosis, ports: set[str]) -> float:
    """The probability that something acts at any of these ports; a pair at two of them counts once."""
    catalogue = diagnosis.given.catalogue
    return fsum(
        each.probability
        for each in diagnosis.candidates
        if any(action.port in ports for action in actions_of(each, catalogue))
    )


def _port(port: Branch, called: str) -> NestedBar:
    families, start = [], 0.0
    for each in filter(_shown, port.branches):
        words = " + ".join(_FAMILY_WORDS.get(family, family) for family in each.name.split(" + "))
        families.append(_bar(words, each, start, _laws(each, start)))
        start += each.probability
    others = _others(("family", "families"), port.branches, start)
    return _bar(called, port, 0.0, (*families, *others), code=port.name if port.name != called else "")


def _laws(family: Branch, start: float) -> tuple[NestedBar, ...]:
    bars = []
    for each in filter(_shown, family.branches):
        bars.append(_bar("" if each.name else "learned law", each, start, code=each.name))
        start += each.probability
    return (*bars, *_others(("law", "laws"), family.branches, start))


def _others(words: tuple[str, str], branches: Sequence[Branch], start: float) -> tuple[NestedBar, ...]:
    """The bar of those that have none of their own, if there is something to be seen of it."""
    left = [each.probability for each in branches if not _shown(each)]
    return (_rest(words, len(left), fsum(left), start),) if fsum(left) >= _PART else ()


def _rest(words: tuple[str, str], count: int, probability: float, start: float) -> NestedBar:
    together = f"{count} other {words[1]} together" if count > 1 else f"1 other {words[0]}"
    return _bar(together, Branch("", probability, named=False), start)


def _bar(
    words: str, branch: Branch, start: float, parts: tuple[NestedBar, ...] = (), code: str = ""
) -> NestedBar:
    return NestedBar(
        words=words,
        code=code,
        probability=probability_words(branch.probability),
        start=round(100.0 * start, 3),
        length=round(100.0 * min(branch.probability, 1.0), 3),
        named=branch.named,
        parts=parts,
    )
