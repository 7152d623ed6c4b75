"""What a report on a model alone follows from: the rig file and the effects, no recordings."""

from collections.abc import Mapping
from dataclasses import dataclass

from savgs_ident.report.origin import versions_of

PACKAGES = ("jax", "numpy", "scipy", "control", "slycot")
"""Whose version matters to linear models and controllers."""


@dataclass(frozen=True)
class ModelOrigin:
    """Where a result on a model comes from.

    Attributes:
        rig: the rig's name.
        model: the rig file.
        effects: what acts in the model besides the frictionless rig.
        command: the command line.
        versions: of the packages that computed it.
    """

    rig: str
    model: str
    effects: tuple[str, ...]
    command: tuple[str, ...]
    versions: Mapping[str, str]

    @property
    def with_effects(self) -> str:
        """The effects in words."""
        return ", ".join(self.effects) or "no friction"

    @property
    def command_line(self) -> str:
        """The command as it was typed, quotes left out."""
        return " ".join(self.command)


def model_origin(rig: str, model: object, effects: tuple[str, ...], command: tuple[str, ...]) -> ModelOrigin:
    """The origin of a result on the rig file ``model``, with the versions of what is installed."""
    return ModelOrigin(rig, str(model), effects, command, versions_of(PACKAGES))
