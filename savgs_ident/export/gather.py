"""Collect what is known about a model before it is exported: model file, posterior, diagnosis.

The three may come from different runs. What they say about each other is checked here and reported: ``said`` are
sentences on the origin of the numbers, ``doubts`` are reasons not to trust them.

A diagnosis is the ``diagnosis.json`` that ``savgs-ident diagnose`` wrote. What an export needs of it is checked
when it is read; the rest is carried along unchanged. Effects that its verdict names are added to the model,
together with all numbers of the fit in which they were found: numbers that were fitted without an effect
compensate for its absence (a soft tyre for a soft mount) and do not belong to the model with it. So
``identified`` of the diagnosis replaces the numbers of the model, and the covariance of the earlier fit is
dropped. Something unknown is added as the force that was learned at its port. Where no force could be learned,
the diagnosis is carried along as data and the model is not changed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from savgs_ident.core.errors import InputError
from savgs_ident.effects.base import AbstractSensorLaw
from savgs_ident.export.document import JsonValue, read_document
from savgs_ident.export.exported_model import ExportedModel, learned_effects, with_effects
from savgs_ident.inference.draws import (
    FAR,
    Draws,
    DrawSource,
    far_from_draws,
    read_draws,
    source_name,
    thin_draws,
)
from savgs_ident.plants.model import Model

DIAGNOSIS_SCHEMAS = (1, 2)
"""The schemas of the diagnoses that can be read: the second one adds to the first."""
VERDICT_KINDS = ("none", "effect", "several", "unknown")
"""The kinds of verdicts."""
DIAGNOSIS_REMEDY = "give the diagnosis.json that `savgs-ident diagnose` wrote"
_DIAGNOSIS_KEYS = ("schema", "baseline", "verdict", "where", "which", "shrink", "next_test")
_VERDICT_KEYS = ("kind", "effects", "ports", "confusable_with", "sentence")
LISTED = 6
"""Most numbers that a sentence lists."""
_OF_THE_FIT = ("covariance",)


@dataclass(frozen=True)
class Gathered:
    """A model to be exported, with what a reader must know about it.

    Attributes:
        model: the model.
        said: the origin of its numbers, a sentence each.
        doubts: reasons not to trust it, a sentence each; empty if there are none.
    """

    model: ExportedModel
    said: tuple[str, ...]
    doubts: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosed:
    """A model after a diagnosis.

    Attributes:
        model: with the effects and the numbers of the diagnosis, where effects were added.
        added: those that the diagnosis added.
        said: what was done, a sentence each, for reports and files.
        taken: names of the parameters whose numbers come from the diagnosis.
    """

    model: Model
    added: tuple[str, ...]
    said: tuple[str, ...]
    taken: tuple[str, ...] = ()


def gather(
    model: Model,
    diagnosis: Mapping[str, object] = MappingProxyType({}),
    posterior: DrawSource | None = None,
    count: int | None = None,
) -> Gathered:
    """A model, what a ``diagnosis`` adds to it, and ``count`` draws of its posterior.

    The sentences are also the ``notes`` in the provenance of the model, so that they are part of the files.
    Raises :class:`InputError` for a diagnosis of another model or draws that cannot be used.
    """
    found = with_diagnosis(model, diagnosis) if diagnosis else Diagnosed(model, (), ())
    exported = ExportedModel(found.model, diagnosis=diagnosis)
    doubts = [*_doubts_of_fit(model, found), *_doubts_of_diagnosis(diagnosis)]
    if posterior is not None:
        draws = read_draws(posterior, tuple(exported.table))
        doubts += _doubts_of_draws(exported, draws, found.added, posterior)
        exported = replace(exported, samples=thin_draws(draws, count))
    said = (*_other_model(model), *found.said, *_sensors(exported))
    notes = [*said, *doubts]
    if notes:
        noted = found.model.with_provenance({**found.model.provenance, "notes": notes})
        exported = replace(exported, model=noted)
    return Gathered(exported, said, tuple(doubts))


def _source_of(model: Model) -> str:
    """What the numbers of a model are read from, in words."""
    return "rig file" if model.origin().model else "model"


def _other_model(model: Model) -> tuple[str, ...]:
    """Whether the model was identified with other effects than those asked for."""
    known, effects = model.provenance.get("effects"), model.effects
    if not isinstance(known, list | tuple) or set(map(str, known)) == set(effects):
        return ()
    return (
        f"The {_source_of(model)} was identified with {listed(known) or 'no friction'} and is taken with"
        f" {listed(effects) or 'no friction'}: what the model has of its numbers is of that fit.",
    )


def _sensors(model: ExportedModel) -> tuple[str, ...]:
    """The sensor effects that the equations leave out."""
    return tuple(
        f"{effect.name} is an error of a sensor, not of the rig: the outputs of the equations are without it."
        for effect in model.plant.effects
        if isinstance(effect.law, AbstractSensorLaw)
    )


def _doubts_of_fit(model: Model, found: Diagnosed) -> tuple[str, ...]:
    if model.provenance.get("trusted", True):
        return ()
    moved = _moved_by_fit(model)
    left = [name for name in moved if name not in found.taken]
    if moved and not left:  # The diagnosis fitted all of them anew.
        return ()
    said = model.provenance
    why = said.get("doubt", said.get("status", "no status"))
    doubt = f"The {_source_of(model)}'s own fit is not to be trusted ({why})"
    if not found.added:
        return (f"{doubt}.",)
    names = f" ({', '.join(left[:LISTED])}{', ...' if len(left) > LISTED else ''})" if left else ""
    return (f"{doubt}, and some of its numbers{names} are in the model still: the diagnosis has no others.",)


def _moved_by_fit(model: Model) -> tuple[str, ...]:
    """Names of the parameters that the fit of the model moved, as far as its provenance records them.

    Those that were held by a tolerance are included.
    """
    recorded = (model.provenance.get(name) for name in ("free", "before"))
    names = [str(name) for each in recorded if isinstance(each, list | tuple | Mapping) for name in each]
    return tuple(dict.fromkeys(names))


def _doubts_of_diagnosis(document: Mapping[str, object]) -> tuple[str, ...]:
    return () if document.get("converged", True) else ("The diagnosis did not converge.",)


def _doubts_of_draws(
    model: ExportedModel, draws: Mapping[str, Draws], added: tuple[str, ...], path: DrawSource
) -> list[str]:
    """Whether the draws, all of them, are those of this model."""
    own = [
        entry.name for effect in model.plant.effects if effect.name in added for entry in effect.parameters
    ]
    lacking = [name for name in own if name not in draws]
    doubts = []
    if lacking:
        doubts.append(
            f"{source_name(path)} is the posterior of a model without {' and '.join(added)}: it has no draws of "
            f"{', '.join(lacking)}, and its other draws are not those of the exported model."
        )
    far = far_from_draws(model.table.as_dict(), draws)
    if far:
        doubts.append(
            f"{source_name(path)} lies elsewhere than the model: {', '.join(far[:4])}"
            f" {'is' if len(far) == 1 else 'are'} more than {FAR:g} standard deviations off its draws."
        )
    return doubts


def with_diagnosis(model: Model, diagnosis: Mapping[str, Any]) -> Diagnosed:
    """The model with what the diagnosis names; see the module.

    ``diagnosis`` is the document of :func:`read_diagnosis`. Raises
    :class:`InputError` if it is one of another model, or lacks a number that its effects need.
    """
    verdict, source = diagnosis["verdict"], _source_of(model)
    if verdict["kind"] == "none":
        said = f"The diagnosis finds nothing missing: the numbers are those of the {source}."
        return Diagnosed(model, (), (said,))
    if verdict["kind"] == "unknown" or (diagnosis.get("learned") and not verdict.get("law_known", True)):
        return _with_unknown(model, diagnosis)
    named = tuple(verdict["effects"])
    added = tuple(name for name in named if name not in model.effects)
    if not added:
        said = f"{listed(named)}, named by the diagnosis, is in the model already: the numbers are the {source}'s."
        return Diagnosed(model, (), (said,))
    fitted = _fitted(frozenset(named), diagnosis["which"])
    return _with_effects(model, added, diagnosis, fitted, diagnosis.get("identified", {}))


def _with_unknown(model: Model, diagnosis: Mapping[str, Any]) -> Diagnosed:
    """The model with the force that was learned for something unknown, if one was."""
    ports, learned = diagnosis["verdict"]["ports"], diagnosis.get("learned")
    if learned is None:
        said = (
            f"The diagnosis finds something that the catalogue does not have (at {', '.join(ports) or 'no port'}) and"
            " that no force there explains: it travels along as data, the equations are without it and the numbers"
            f" those of the {_source_of(model)}."
        )
        return Diagnosed(model, (), (said,))
    if learned["effect"] in model.effects:
        return Diagnosed(model, (), (f"{learned['effect']}, learned before, is in the model already.",))
    fitted = {name: float(entry["value"]) for name, entry in learned["parameters"].items()}
    found = _with_effects(model, (learned["effect"],), diagnosis, fitted, learned["identified"])
    held = "It is held at the edge of the motion in the campaign: beyond, it is a guess."
    return replace(found, said=(*found.said, held))


def _with_effects(
    model: Model,
    added: tuple[str, ...],
    diagnosis: Mapping[str, Any],
    fitted: Mapping[str, float],
    identified: Mapping[str, float],
) -> Diagnosed:
    """The model with ``added`` effects: their own numbers ``fitted``, and all ``identified`` along with them [SI]."""
    _check_baseline(model.effects, diagnosis)
    whole, values = with_effects(model, added), {**identified, **fitted}
    for name in whole.table:
        if name not in values and name not in model.table:
            raise InputError(f"gives no value for '{name}', a parameter of what it names")
    diagnosed = whole.with_values(values)
    table = diagnosed.table
    own, source = [name for name in values if name not in fitted], _source_of(model)
    said = [
        f"{listed(added)} joins the model as the diagnosis found it: "
        + ", ".join(
            f"{name} = {value:.6g} {table[name].unit}" for name, value in list(fitted.items())[:LISTED]
        )
        + (f", and {len(fitted) - LISTED} more." if len(fitted) > LISTED else ".")
    ]
    if own:
        said.append(
            f"{len(own)} more numbers ({', '.join(own[:4])}, ...) are those that the diagnosis fitted along with it; "
            f"all others are those of the {source}."
        )
    else:
        said.append(
            f"The diagnosis does not say what else it fitted: all other numbers are those of the {source}."
        )
    if "covariance" in model.provenance:
        said.append(f"The covariance of the {source} is of the fit without it and is left out.")
    diagnosed = diagnosed.with_provenance(_provenance(model, whole.effects, diagnosis))
    return Diagnosed(diagnosed, added, tuple(said), tuple(values))


def _fitted(effects: frozenset[str], candidates: list[Mapping[str, Any]]) -> dict[str, float]:
    """The parameters of the hypothesis that the verdict names."""
    for each in candidates:
        if frozenset(_effects_of(each)) == effects and each["parameters"]:
            return {name: float(entry["value"]) for name, entry in each["parameters"].items()}
    raise InputError(f"holds no fitted parameters of {listed(sorted(effects))}")


def _effects_of(candidate: Mapping[str, Any]) -> Iterable[str]:
    """The effects of a hypothesis."""
    named: Iterable[str] = candidate.get("effects") or ()
    return named or _effects_in_words(candidate["effect"])


def _effects_in_words(effect: str) -> Iterable[str]:
    """The effects of a hypothesis of an older file, or of one of the contract alone, which has no list of them."""
    return effect.split(" + ")


def _check_baseline(effects: tuple[str, ...], diagnosis: Mapping[str, Any]) -> None:
    baseline = diagnosis["baseline"].get("effects")
    if baseline is not None and set(baseline) != set(effects):
        raise InputError(
            f"is of a model with {listed(baseline) or 'no friction'}, not of one with"
            f" {listed(effects) or 'no friction'}",
            remedy="export the rig file that was diagnosed, or choose its model with --model",
        )


def _provenance(model: Model, effects: tuple[str, ...], diagnosis: Mapping[str, Any]) -> dict[str, object]:
    """The origin of the numbers: the diagnosis, and the provenance of the earlier fit."""
    origin = diagnosis.get("provenance", {})
    found: dict[str, object] = {"effects": list(effects), "from": "diagnosis"}
    found |= {name: origin[name] for name in ("data", "data_sha256", "model", "versions") if name in origin}
    before = {name: value for name, value in model.provenance.items() if name not in _OF_THE_FIT}
    return found | ({"fit_before": before} if before else {})


def listed(names: Iterable[object]) -> str:
    """Names in a sentence."""
    return " and ".join(map(str, names))


def read_diagnosis(path: Path, model: Model) -> dict[str, object]:
    """The whole document, of a diagnosis of the ``model`` with any effects.

    Raises :class:`InputError` for a file that cannot be read or is no diagnosis.
    """
    return read_document(path, DIAGNOSIS_REMEDY, lambda place: parse_diagnosis(place, model))


def parse_diagnosis(place: JsonValue, model: Model) -> dict[str, object]:
    """The document at a place. Raises :class:`InputError` for what is no diagnosis of such a model."""
    learned = tuple(learned_effects(model))
    named = tuple(name for name in model.catalogue if name not in learned)
    fields = place.table(_DIAGNOSIS_KEYS, free=True)
    schema = fields["schema"]
    if schema.value not in DIAGNOSIS_SCHEMAS or isinstance(schema.value, bool):
        raise schema.wrong(f"one of the schemas {', '.join(map(str, DIAGNOSIS_SCHEMAS))}")
    baseline = fields["baseline"].table(("model", "parameters"), free=True)
    baseline["model"].text()
    _numbers(baseline["parameters"])
    if "effects" in baseline:
        baseline["effects"].names((*named, *learned))
    _check_verdict(fields["verdict"], named)
    for candidate in fields["which"].items():
        _check_candidate(candidate)
    if "identified" in fields:
        _numbers(fields["identified"])
    if "learned" in fields and fields["learned"].value is not None:
        _check_learned(fields["learned"], learned)
    if "converged" in fields and not isinstance(fields["converged"].value, bool):
        raise fields["converged"].wrong("true or false")
    if "provenance" in fields:
        fields["provenance"].entries()
    return dict(_as_table(place))


def _check_verdict(place: JsonValue, known: tuple[str, ...]) -> None:
    fields = place.table(_VERDICT_KEYS, free=True)
    kind = fields["kind"].text(VERDICT_KINDS)
    named = fields["effects"].names(known)
    if (kind in ("effect", "several")) != bool(named):
        raise fields["effects"].wrong(f"what belongs to a verdict of the kind '{kind}'")
    fields["ports"].names()
    fields["confusable_with"].names()
    fields["sentence"].text()
    if "confusable_ports" in fields:
        fields["confusable_ports"].names()
    for name in ("law_known", "another_law"):
        if name in fields and not isinstance(fields[name].value, bool):
            raise fields[name].wrong("true or false")


def _check_candidate(place: JsonValue) -> None:
    fields = place.table(("effect", "parameters"), free=True)
    fields["effect"].text()
    for entry in fields["parameters"].entries().values():
        entry.table(("value", "unit"), free=True)["value"].number()


def _check_learned(place: JsonValue, learned: tuple[str, ...]) -> None:
    fields = place.table(("effect", "parameters", "identified"), free=True)
    fields["effect"].text(learned)
    for entry in fields["parameters"].entries().values():
        entry.table(("value", "unit"), free=True)["value"].number()
    _numbers(fields["identified"])


def _numbers(place: JsonValue) -> dict[str, float]:
    return {name: entry.number() for name, entry in place.entries().items()}


def _as_table(place: JsonValue) -> Mapping[str, object]:
    return {name: entry.value for name, entry in place.entries().items()}
