"""The marks of a blind trial: a diagnosis held against its answer. Pure functions.

    score = score_of(answer, diagnosis)      # ``diagnosis`` as ``diagnosis.json`` has it

An effect counts as named by its own name, and as a formula of the catalogue. Where another effect does the same to
the campaign, so that nothing shows which it is, naming that one counts too, if the verdict says that it cannot
distinguish the two: where the draw found so, or where the drawn effects are about as probable by the same recordings
(log odds below 5 nat). Instead of an effect that was removed one that does the same may be named without: where the
draw found so, or where the removed effect, fitted to the same recordings, is no more probable (by 5 nat).
The port of something unknown counts as found, too, where the verdict says that it cannot distinguish it from the one
that it names; that of an effect in whose place a law was learned, where the effect itself explains the recordings as
well there. Marks that do not apply to a kind of trial are None.

In a foreign trial no name can be right, for no catalogue has the law. A port is right where an engineer would rightly
put the effect, a family where it would rightly be called that, at such a port
(:mod:`savgs_ident.validation.foreign_laws`). "Unknown" at a right port has the port, not the family. Where the drawn
law itself explains the recordings as well at another port (:mod:`savgs_ident.validation.other_port`), no diagnosis
can distinguish the two: naming that one counts, too, if the verdict says that it cannot.

Of an effect of which calibration leaves too little to be seen or to matter it is right to say nothing: it has no name
and no port then. So it is where the draw found it, with an exact damper's table, or where the recalibrated model
misses tests that were held out by less than matters beyond their noise.

The record of the marks is in :mod:`savgs_ident.validation.blind_score`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import exp, isfinite
from typing import Any

from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.effects.effect import Effect, families_of
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.blind_answer import Answer
from savgs_ident.validation.blind_score import FAILED, Interval, Score, Statement


def port_in_question(answer: Answer, diagnosis: Mapping[str, Any]) -> str | None:
    """The one port that a verdict names, where it is wrong but a right one is listed as indistinguishable from it.

    Of foreign effects, and of those that were removed from the catalogue where a law is learned in their place.
    """
    verdict = diagnosis["verdict"]
    learned = verdict["kind"] == "effect" and _no_known_law(verdict)
    right = answer.accepted if answer.kind == "foreign" else answer.ports
    if not (answer.kind == "foreign" or (answer.kind == "unknown" and learned)):
        return None
    if _ports_among(right, verdict) or not _listed_among(right, verdict):
        return None
    return str(verdict["ports"][0]) if len(verdict["ports"]) == 1 else None


def stand_in(answer: Answer, diagnosis: Mapping[str, Any]) -> str | None:
    """The one effect that is named instead of one that was removed from the catalogue."""
    verdict = diagnosis["verdict"]
    one = answer.kind == "unknown" and verdict["kind"] == "effect" and not _no_known_law(verdict)
    return str(verdict["effects"][0]) if one else None


def score_of(
    answer: Answer,
    diagnosis: Mapping[str, Any],
    version: str = "",
    elsewhere: float | None = None,
    catalogue: Mapping[str, Effect] = CATALOGUE,
) -> Score:
    """The marks of a diagnosis, given as the object of its ``diagnosis.json``; ``version`` is that of the code.

    ``elsewhere`` are the log odds of the drawn law at its own port against it at the :func:`port_in_question`, or
    against its :func:`stand_in`. ``catalogue`` has the effects that the diagnosis knows.
    """
    verdict, kind = diagnosis["verdict"], answer.kind
    said, true = tuple(verdict["effects"]), {*answer.effects}
    known = bool(verdict.get("law_known", True))
    right = known and {*said} == true and len(said) == len(true)
    alike = known and _as_well(answer, diagnosis)
    here = {*verdict["ports"]} == {*answer.ports} and verdict["kind"] != "none"
    beside = verdict["kind"] == "unknown" and {*answer.ports} <= {*verdict["confusable_ports"]}
    beside = beside or (kind == "unknown" and _does_the_same(elsewhere))
    families, foreign = tuple(verdict.get("families", ())), answer.small_errors is not None
    accepted = _accepted(answer, diagnosis, elsewhere)
    own = _intervals(answer, diagnosis) if right else {}
    instead = stand_in(answer, diagnosis)
    score = Score(
        number=answer.number,
        kind=kind,
        effects=answer.effects,
        changes=tuple(answer.changes[name] for name in answer.effects),
        verdict=verdict["kind"],
        said=said,
        named_right=right or alike if kind == "effect" else None,
        named_exactly=right if kind == "effect" else None,
        located_right=here or alike or beside if kind in _CATALOGUED else None,
        located_exactly=here if kind in _CATALOGUED else None,
        false_alarm=verdict["kind"] not in ("none", FAILED) if kind == "none" else None,
        unknown_recognised=_no_known_law(verdict) if kind == "unknown" else None,
        both_named=right or alike if kind == "two" else None,
        share_closed=diagnosis["shrink"]["share_closed"],
        intervals=_rig_intervals(answer, diagnosis) if foreign else own,
        wall_s=float(diagnosis["wall_s"]),
        foreign=foreign,
        families=families,
        sigmas=tuple(answer.sigmas[name] for name in answer.effects if name in answer.sigmas),
        port_right=_ports_among(accepted, verdict) if kind == "foreign" else None,
        port_exactly=_ports_among(answer.accepted, verdict) if kind == "foreign" else None,
        port_listed=_listed_among(answer.accepted, verdict) if kind == "foreign" else None,
        family_right=_family_right(accepted, answer, verdict, families) if kind == "foreign" else None,
        family_exactly=_family_right(answer.accepted, answer, verdict, families)
        if kind == "foreign"
        else None,
        elsewhere=elsewhere,
        probability=_number_or_none(verdict.get("probability")),
        closed_by_effect=_number_or_none(diagnosis["shrink"].get("closed_by_effect")),
        version=version,
        hidden=_hidden(answer, diagnosis),
        meant=tuple(sorted(_meant(answer, diagnosis))),
        law_known=known,
        imitated=instead is not None and (instead in answer.imitators or _does_the_same(elsewhere)),
        statements=tuple(_statements(answer, diagnosis, catalogue)),
    )
    unmarked: dict[str, Any] = dict.fromkeys(_OF_WHAT_IS_THERE)
    return replace(score, **unmarked) if score.left_alone or score.imitated else score


_CATALOGUED = ("effect", "two", "unknown")
"""Kinds of trials whose effects are of the catalogue."""

_OF_WHAT_IS_THERE = (
    *("named_right", "named_exactly", "located_right", "located_exactly", "unknown_recognised", "both_named"),
    *("port_right", "port_exactly", "port_listed", "family_right", "family_exactly"),
)
"""Marks that nobody could earn where what is there cannot be seen, or told from what is named."""


def _statements(
    answer: Answer, diagnosis: Mapping[str, Any], catalogue: Mapping[str, Effect]
) -> Iterator[Statement]:
    """What a verdict says of ports, families and laws, with the probabilities of all hypotheses that say the same."""
    # Diagnoses of earlier versions, and those that failed, state less.
    verdict = diagnosis["verdict"]
    which = [each for each in diagnosis["which"] if _number_or_none(each.get("probability")) is not None]
    named = verdict["kind"] in ("effect", "several")
    places = {each["port"]: each["probability"] for each in diagnosis.get("where", {}).get("ports", ())}
    for port in verdict["ports"]:
        if port in places:
            yield Statement("port", port, places[port], port in {*answer.accepted, *answer.ports})
    right = {f"{port}/{family}" for port in answer.accepted for family in answer.families}
    if answer.kind != "foreign":
        right = _families(answer.effects, catalogue)
    for family in verdict.get("families", ()) if named and which else ():
        share = sum(each["probability"] for each in which if family in _families_said(each, catalogue))
        yield Statement("family", family, share, family in right)
    stated = _number_or_none(verdict.get("probability"))
    if named and verdict.get("law_known", True) and stated is not None:
        yield Statement(
            "law", " + ".join(verdict["effects"]), stated, {*verdict["effects"]} == {*answer.effects}
        )


def _families_said(candidate: Mapping[str, Any], catalogue: Mapping[str, Effect]) -> set[str]:
    """The families of a hypothesis of ``diagnosis.json``: its own, or those of its effects."""
    if candidate.get("port") and candidate.get("family"):
        return {f"{candidate['port']}/{candidate['family']}"}
    return _families(candidate["effects"], catalogue)


def _families(effects: Sequence[str], catalogue: Mapping[str, Effect]) -> set[str]:
    return {f"{place}/{family.value}" for place, family in families_of([catalogue[name] for name in effects])}


def _as_well(answer: Answer, diagnosis: Mapping[str, Any]) -> bool:
    """Whether in place of one drawn effect another is named that does the same, which the verdict says."""
    verdict = diagnosis["verdict"]
    said, true = {*verdict["effects"]}, {*answer.effects}
    instead, left_out = said - true, true - said
    one_for_one = len(said) == len(true) and len(instead) == 1
    listed = one_for_one and left_out <= {*verdict["confusable_with"]}
    return listed and _does_as_well(answer, true, said, diagnosis)


def _does_as_well(answer: Answer, true: set[str], said: set[str], diagnosis: Mapping[str, Any]) -> bool:
    """Whether what is named does the same as what was drawn: by the draw, or by the same recordings."""
    return said - true <= {*answer.imitators} or _about_as_probable(true, said, diagnosis)


def _about_as_probable(true: set[str], said: set[str], diagnosis: Mapping[str, Any]) -> bool:
    """Whether the recordings do not tell the drawn effects from those that are named."""
    stated = {
        frozenset(each["effects"]): _number_or_none(each.get("probability")) for each in diagnosis["which"]
    }
    there, named = (stated.get(frozenset(each)) or 0.0 for each in (true, said))
    return there > named * exp(-DEFAULTS.indistinguishable_log_odds)


def _hidden(answer: Answer, diagnosis: Mapping[str, Any]) -> bool:
    """Whether calibration hides every drawn effect that is not named; of a foreign one, none has its name."""
    all_of_it = answer.kind != "none" and _calibrated(diagnosis["shrink"])
    unseen = {*answer.effects} if all_of_it else answer.out_of_sight
    missed = {*answer.effects} - _meant(answer, diagnosis)
    return bool(missed) and missed <= unseen


def _meant(answer: Answer, diagnosis: Mapping[str, Any]) -> set[str]:
    """The drawn effects that a verdict names, or the one in whose place it names another that does the same."""
    if answer.kind == "foreign":
        return set()
    verdict = diagnosis["verdict"]
    said, true = {*verdict["effects"]}, {*answer.effects}
    listed = (true - said) & {*verdict["confusable_with"]}
    if len(said) == len(said - true) == len(listed) == 1 and _does_as_well(answer, listed, said, diagnosis):
        return listed
    return said & true


def _calibrated(shrink: Mapping[str, Any]) -> bool:
    """Whether the recalibrated model misses held-out tests by less than matters beyond the noise."""
    gap, noise = (_number_or_none(shrink.get(name)) for name in ("recalibrated", "floor"))
    return gap is not None and noise is not None and gap**2 - noise**2 < DEFAULTS.material_share**2


def _no_known_law(verdict: Mapping[str, Any]) -> bool:
    """Whether something is said to be missing that follows no formula of the catalogue."""
    learned = verdict["kind"] == "effect" and not verdict.get("law_known", True)
    return learned or verdict["kind"] == "unknown"


def _accepted(answer: Answer, diagnosis: Mapping[str, Any], elsewhere: float | None) -> tuple[str, ...]:
    """The ports that are right, and the one in question where the drawn law itself does the same."""
    other = port_in_question(answer, diagnosis)
    return (*answer.accepted, other) if other is not None and _does_the_same(elsewhere) else answer.accepted


def _does_the_same(elsewhere: float | None) -> bool:
    """Whether the drawn law does the same at the other port, by its log odds [nat]."""
    return elsewhere is not None and elsewhere < DEFAULTS.indistinguishable_log_odds


def _ports_among(right: Sequence[str], verdict: Mapping[str, Any]) -> bool:
    """Whether something is said to be missing, at ports that are right alone."""
    ports = set(verdict["ports"])
    return verdict["kind"] not in ("none", FAILED) and bool(ports) and ports <= {*right}


def _listed_among(right: Sequence[str], verdict: Mapping[str, Any]) -> bool:
    """Whether the ports are right, or one that is right is listed as indistinguishable from them."""
    listed = verdict["kind"] not in ("none", FAILED) and bool({*verdict["confusable_ports"]} & {*right})
    return listed or _ports_among(right, verdict)


def _family_right(
    accepted: Sequence[str], answer: Answer, verdict: Mapping[str, Any], families: Sequence[str]
) -> bool:
    """Whether a family is named, and all that are named are right, at accepted ports."""
    right = {f"{port}/{family}" for port in accepted for family in answer.families}
    named = verdict["kind"] in ("effect", "several") and bool(families)
    return named and set(families) <= right and _ports_among(accepted, verdict)


def _number_or_none(found: object) -> float | None:
    """A finite number, or None."""
    return float(found) if isinstance(found, int | float) and isfinite(found) else None


MEANINGFUL: Mapping[str, tuple[str, ...]] = {
    "mu_r": ("rail/friction",),
    "c_sd": ("strut/damping", "strut/friction", "strut/play", "suspension/damping", "suspension/friction"),
}
"""Parameters of the rig whose true values mean something whatever is missing, but for what acts as they do."""


def _rig_intervals(answer: Answer, diagnosis: Mapping[str, Any]) -> dict[str, Interval]:
    """Intervals of the rig's own parameters in a foreign trial, where the diagnosis gives them.

    Rail friction that drifts has its mean as the true value.
    """
    there = {f"{port}/{family}" for port in answer.ports for family in answer.families}
    given = diagnosis.get("intervals", {})
    return {
        name: Interval(answer.rig[name], given[name]["lo"], given[name]["hi"])
        for name, alike in MEANINGFUL.items()
        if name in answer.rig and name in given and not there & {*alike}
        if None not in (given[name]["lo"], given[name]["hi"])
    }


def failed(why: str, trace: str = "") -> dict[str, Any]:
    """What stands for the ``diagnosis.json`` of a diagnosis that ended with an error; ``trace`` says where it did."""
    verdict = {
        "kind": FAILED,
        "effects": [],
        "ports": [],
        "confusable_with": [],
        "sentence": why,
        "confusable_ports": [],
    }
    shrink = {"share_closed": None}
    return {"verdict": verdict, "which": [], "shrink": shrink, "wall_s": 0.0, "traceback": trace.splitlines()}


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
