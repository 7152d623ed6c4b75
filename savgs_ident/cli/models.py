"""Which model a command works with: the names on the command line, and what a rig file remembers."""

from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from savgs_ident.core.errors import InputError

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
    from savgs_ident.effects.registry import CATALOGUE

    named = rig.provenance.get("effects", effects_of(ModelName.simtr))
    if not isinstance(named, list | tuple) or any(name not in CATALOGUE for name in named):
        raise InputError(
            f"provenance.effects is {named!r}",
            source=source,
            remedy="list known effects: " + ", ".join(sorted(CATALOGUE)),
        )
    return tuple(named)


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
