"""The model with what a diagnosis found missing in it.

Effects that the verdict names join the model. With them come all numbers of the fit in which they were found: what
was fitted without them makes up for their absence, a soft mount by a soft tyre, and does not belong to the model with
them. So ``identified`` of the diagnosis replaces what the rig file has, and the covariance of the earlier fit is left
behind.

Something unknown joins as the force that was learned at its port. Where nothing could be learned that is a force, the
diagnosis travels along as data and the model stays.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import EFFECTS, model_parameters

TOLD = 6
"""Most numbers that a sentence tells."""

_OF_THE_FIT = ("covariance",)


@dataclass(frozen=True)
class Diagnosed:
    """A model after a diagnosis.

    Attributes:
        rig: with the numbers of the diagnosis, where effects were added.
        effects: all in the model.
        added: those that the diagnosis added.
        said: what was done, a sentence each, for reports and files.
        taken: names of the parameters whose numbers are those of the diagnosis.
    """

    rig: Rig
    effects: tuple[str, ...]
    added: tuple[str, ...]
    said: tuple[str, ...]
    taken: tuple[str, ...] = ()


def with_diagnosis(rig: Rig, effects: tuple[str, ...], diagnosis: Mapping[str, Any]) -> Diagnosed:
    """The model of ``effects`` with what the diagnosis names; see the module.

    ``diagnosis`` is what :func:`savgs_ident.export.diagnosis_document.read_diagnosis` returns. Raises
    :class:`InputError` if it is one of another model, or lacks a number that its effects need.
    """
    verdict = diagnosis["verdict"]
    if verdict["kind"] == "none":
        said = "The diagnosis finds nothing missing: the numbers are those of the rig file."
        return Diagnosed(rig, effects, (), (said,))
    if verdict["kind"] == "unknown":
        return _with_unknown(rig, effects, diagnosis)
    named = tuple(verdict["effects"])
    added = tuple(name for name in named if name not in effects)
    if not added:
        said = f"{listed(named)}, named by the diagnosis, is in the model already: the numbers are the rig file's."
        return Diagnosed(rig, effects, (), (said,))
    fitted = _fitted(frozenset(named), diagnosis["which"])
    return _with_effects(rig, effects, added, diagnosis, fitted, diagnosis.get("identified", {}))


def _with_unknown(rig: Rig, effects: tuple[str, ...], diagnosis: Mapping[str, Any]) -> Diagnosed:
    """The model with the force that was learned for something unknown, if one was."""
    ports, learned = diagnosis["verdict"]["ports"], diagnosis.get("learned")
    if learned is None:
        said = (
            f"The diagnosis finds something that the catalogue does not have (at {', '.join(ports) or 'no port'}) and"
            " that no force there explains: it travels along as data, the equations are without it and the numbers"
            " those of the rig file."
        )
        return Diagnosed(rig, effects, (), (said,))
    if learned["effect"] in effects:
        return Diagnosed(
            rig, effects, (), (f"{learned['effect']}, learned before, is in the model already.",)
        )
    fitted = {name: float(entry["value"]) for name, entry in learned["parameters"].items()}
    found = _with_effects(rig, effects, (learned["effect"],), diagnosis, fitted, learned["identified"])
    held = "It is held at the edge of the motion in the campaign: beyond, it is a guess."
    return replace(found, said=(*found.said, held))


def _with_effects(
    rig: Rig,
    effects: tuple[str, ...],
    added: tuple[str, ...],
    diagnosis: Mapping[str, Any],
    fitted: Mapping[str, float],
    identified: Mapping[str, float],
) -> Diagnosed:
    """The model with ``added`` effects: their own numbers ``fitted``, and all ``identified`` along with them [SI]."""
    _check_baseline(effects, diagnosis)
    whole = (*effects, *added)
    values = {**identified, **fitted}
    for name in (each.name for effect in added for each in EFFECTS[effect].parameters):
        if name not in values and name not in rig.parameters:
            raise InputError(f"gives no value for '{name}', a parameter of what it names")
    table = model_parameters(rig, whole).with_values(values)
    own = [name for name in values if name not in fitted]
    said = [
        f"{listed(added)} joins the model as the diagnosis found it: "
        + ", ".join(f"{name} = {value:.6g} {table[name].unit}" for name, value in list(fitted.items())[:TOLD])
        + (f", and {len(fitted) - TOLD} more." if len(fitted) > TOLD else ".")
    ]
    if own:
        said.append(
            f"{len(own)} more numbers ({', '.join(own[:4])}, ...) are those that the diagnosis fitted along with it; "
            "all others are those of the rig file."
        )
    else:
        said.append(
            "The diagnosis does not say what else it fitted: all other numbers are those of the rig file."
        )
    if "covariance" in rig.provenance:
        said.append("The covariance of the rig file is of the fit without it and is left out.")
    identified_rig = Rig(
        rig.name, table, rig.damper_velocity, rig.damper_force, _provenance(rig, whole, diagnosis)
    )
    return Diagnosed(identified_rig, whole, added, tuple(said), tuple(values))


def _fitted(effects: frozenset[str], candidates: list[Mapping[str, Any]]) -> dict[str, float]:
    """The parameters of the hypothesis that the verdict names."""
    for each in candidates:
        names = each.get("effects") or each["effect"].split(" + ")
        if frozenset(names) == effects and each["parameters"]:
            return {name: float(entry["value"]) for name, entry in each["parameters"].items()}
    raise InputError(f"holds no fitted parameters of {listed(sorted(effects))}")


def _check_baseline(effects: tuple[str, ...], diagnosis: Mapping[str, Any]) -> None:
    baseline = diagnosis["baseline"].get("effects")
    if baseline is not None and set(baseline) != set(effects):
        raise InputError(
            f"is of a model with {listed(baseline) or 'no friction'}, not of one with"
            f" {listed(effects) or 'no friction'}",
            remedy="export the rig file that was diagnosed, or choose its model with --model",
        )


def _provenance(rig: Rig, effects: tuple[str, ...], diagnosis: Mapping[str, Any]) -> dict[str, object]:
    """Where the numbers come from now: the diagnosis, and what the rig file said of the fit before."""
    origin = diagnosis.get("provenance", {})
    found: dict[str, object] = {"effects": list(effects), "from": "diagnosis"}
    found |= {name: origin[name] for name in ("data", "data_sha256", "model", "versions") if name in origin}
    before = {name: value for name, value in rig.provenance.items() if name not in _OF_THE_FIT}
    return found | ({"fit_before": before} if before else {})


def listed(names: Iterable[object]) -> str:
    """Names in a sentence."""
    return " and ".join(map(str, names))
