"""Which model a command works with: the names on the command line, and what a rig file remembers."""

from collections.abc import Collection, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from savgs_ident.cli.console import complain
from savgs_ident.core.errors import InputError, blamed_on

if TYPE_CHECKING:
    from savgs_ident.core.parameter import ParameterTable
    from savgs_ident.core.rig import Rig


class ModelName(StrEnum):
    """The paper's models."""

    simqc = "simqc"
    simtr = "simtr"


ModelOption = Annotated[
    ModelName, typer.Option("--model", help="simtr: with rail and tyre friction; simqc: without.")
]

BaselineOption = Annotated[
    ModelName | None,
    typer.Option(
        "--model",
        help="simtr: with rail and tyre friction, the default for a drawing; simqc: without. "
        "A model.toml brings its own.",
    ),
]

FREE_BY_DEFAULT = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
"""The parameters that the paper identifies."""


def effects_of(model: ModelName) -> tuple[str, ...]:
    """The effects that make a model."""
    from savgs_ident.effects.registry import MODELS

    return MODELS[model.value]


def effects_in(rig: "Rig", source: object) -> tuple[str, ...]:
    """The effects that an identified rig was fitted with; those of SimTR where the file does not say.

    Raises :class:`InputError` if what it says is no list of known effects.
    """
    from savgs_ident.effects.registry import EFFECTS, model_parameters

    named = rig.provenance.get("effects", effects_of(ModelName.simtr))
    found = _list_of(EFFECTS, named)
    if found is None:
        raise InputError(
            f"provenance.effects is {named!r}",
            source=source,
            remedy="list known effects: " + ", ".join(sorted(EFFECTS)),
        )
    with blamed_on(source):
        # What these effects bring along must go with what the file has.
        model_parameters(rig, found)
    return found


def rig_and_effects(path: Path, model: ModelName | None) -> tuple["Rig", tuple[str, ...]]:
    """The rig of a file with its effects, or those of ``model``; one line on standard error if its fit is doubtful.

    Raises :class:`InputError` if the file cannot be read or what it says of effects is no list of known ones.
    """
    from savgs_ident.core.rig import read_rig

    rig = read_rig(path)
    if not rig.provenance.get("trusted", True):
        complain(
            f"Warning: {path}: its own fit is not to be trusted ({rig.provenance.get('status', 'no status')})."
        )
    return rig, effects_in(rig, path) if model is None else effects_of(model)


def free_parameters(wanted: Sequence[str], model: ModelName, known: "ParameterTable") -> tuple[str, ...]:
    """The parameters to identify: those ``wanted``, or what the model has of the paper's four.

    Raises :class:`InputError` for a name that is not ``known``.
    """
    if not wanted:
        return FREE_BY_DEFAULT if model is ModelName.simtr else ("c_sd",)
    for name in wanted:
        if name not in known:
            raise InputError(
                f"there is no parameter '{name}'", source="--free", remedy="choose among: " + ", ".join(known)
            )
    return tuple(dict.fromkeys(wanted))


def identified_in(
    rig: "Rig", effects: tuple[str, ...], source: object
) -> tuple[tuple[str, ...], dict[str, float]]:
    """The parameters that an identified rig left free, and the values of all that its fit moved [SI].

    Those of the paper and the rig's own values for a drawing. Raises :class:`InputError` if the list in the
    file is none of known parameters.
    """
    from savgs_ident.effects.registry import model_parameters

    table = model_parameters(rig, effects)
    by_default = free_parameters((), ModelName.simtr if effects else ModelName.simqc, table)
    named = rig.provenance.get("free", by_default)
    found = _list_of(table, named)
    if not found:
        raise InputError(
            f"provenance.free is {named!r}", source=source, remedy="list parameters of the model"
        )
    return found, {name: table[name].value for name in (*found, *_before(rig, table, source))}


def rig_before(rig: "Rig", effects: tuple[str, ...], source: object) -> "Rig":
    """An identified rig with the values that were known before its fit: the centres of their priors.

    A drawing is returned as it is. Raises :class:`InputError` if the file's table of them is not of numbers.
    """
    from dataclasses import replace

    from savgs_ident.effects.registry import model_parameters

    table = model_parameters(rig, effects)
    before = _before(rig, table, source)
    with blamed_on(source):
        return replace(rig, parameters=table.with_values(before)) if before else rig


def _list_of(known: Collection[str], named: object) -> tuple[str, ...] | None:
    """What a file names, if it is a list of what is known, nothing in it twice; else None."""
    if not isinstance(named, list | tuple) or not all(isinstance(name, str) for name in named):
        return None
    right = all(name in known for name in named) and len(set(named)) == len(named)
    return tuple(named) if right else None


def _before(rig: "Rig", known: Collection[str], source: object) -> dict[str, float]:
    before = rig.provenance.get("before", {})
    wrong = InputError(
        "provenance.before is no table of numbers", source=source, remedy="identify the rig again"
    )
    if not isinstance(before, Mapping) or not all(isinstance(each, int | float) for each in before.values()):
        raise wrong
    if any(name not in known for name in before):
        raise wrong
    try:
        return {str(name): float(value) for name, value in before.items()}
    except OverflowError:
        raise wrong from None
