"""The model that the public calls take: a rig, and what acts on it besides the frictionless quarter car.

    model = RigModel(read_rig("my_rig.toml")) + "rail_coulomb" + "tyre_friction"
    model = load_model("out/fit/model.toml")      # an identified rig, with the effects that it was fitted with

A drawing knows its parameters beforehand, to a tolerance or not at all. A rig that was identified carries on top what
its fit did: which parameters it left free (:attr:`RigModel.identified`), and what was known of them before
(:attr:`RigModel.before`), so that its values are not counted as knowledge a second time.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from savgs_ident.core.errors import DataWarning, InputError, blamed_on
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Origin
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.base import Channel
from savgs_ident.plants.model import doubts_of_fit
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, EFFECTS, MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.recording import Campaign, RecordingLayout

FREE = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
"""The parameters that the paper identifies."""

_FREE_WITH_AN_EFFECT = {"mu_r": "rail_coulomb", "mu_t": "tyre_friction", "ydot_Hth": "tyre_friction"}
"""Those that mean something in the presence of an effect only."""

_OF_NO_PAPER = frozenset(CATALOGUE).difference(*MODELS.values())
"""The catalogue's effects that are in none of the paper's models."""


@dataclass(frozen=True)
class RigModel:
    """A rig with the effects, by name, that act on it; none makes the paper's SimQC.

    ``model + "rail_coulomb"`` is the model with one more. Raises :class:`InputError` for an effect that nobody knows,
    or whose parameters do not go with the rig's.
    """

    rig: Rig
    effects: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.effects:
            if name not in EFFECTS:
                raise InputError(
                    f"there is no effect '{name}'", remedy="choose among: " + ", ".join(sorted(EFFECTS))
                )
        with blamed_on(self.rig.source):
            model_parameters(self.rig, self.effects)

    def __add__(self, effect: str) -> "RigModel":
        """The model with one more effect; the same model if it is there already."""
        return self if effect in self.effects else replace(self, effects=(*self.effects, effect))

    def __str__(self) -> str:
        return " + ".join((f"frictionless {self.rig.name}", *self.effects))

    @property
    def plant(self) -> type[QuarterCar]:
        """What the rig declares: coordinates, inputs, channels, ports."""
        return QuarterCar

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What the rig's sensors read."""
        return QuarterCar.channels

    @property
    def catalogue(self) -> Mapping[str, Effect]:
        """The effects, by name, that it may have."""
        return EFFECTS

    @property
    def candidates(self) -> Mapping[str, Effect]:
        """The effects, by name, that a diagnosis looks for: those that no diagnosis learned."""
        return CATALOGUE

    @property
    def known_models(self) -> tuple[tuple[str, ...], ...]:
        """The effects of the paper's models."""
        return tuple(MODELS.values())

    @property
    def table(self) -> ParameterTable:
        """All parameters, those of the rig and those that the effects bring along."""
        return model_parameters(self.rig, self.effects)

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Where the rig's numbers come from; empty for a drawing."""
        return self.rig.provenance

    @property
    def is_drawing(self) -> bool:
        """Whether the rig comes from no fit."""
        return "effects" not in self.rig.provenance

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why its values are not to be trusted, a sentence each; empty if they are."""
        return doubts_of_fit(self.rig.source or self.rig.name, self.rig.provenance)

    @property
    def name(self) -> str:
        """Name of the model: "simqc" or "simtr" for a drawing with these effects, else the rig's."""
        known = {frozenset(effects): name for name, effects in MODELS.items()}
        return known.get(frozenset(self.effects), self.rig.name) if self.is_drawing else self.rig.name

    @property
    def plant_name(self) -> str:
        """The rig's name."""
        return self.rig.name

    @property
    def source(self) -> str:
        """The rig file; empty without one."""
        return self.rig.source

    @property
    def sha256(self) -> str:
        """Digest of the rig file's content; empty without one."""
        return self.rig.sha256

    @property
    def layout(self) -> RecordingLayout:
        """The channels that its recordings have."""
        return RIG_LAYOUT

    def build(self) -> QuarterCar:
        """The plant that solvers take."""
        return build_model(self.rig, self.effects)

    def free(self, wanted: Sequence[str] = ()) -> tuple[str, ...]:
        """The parameters to identify: those ``wanted``, or what the model has of the paper's four.

        And what effects of the catalogue that are in none of the paper's models bring along, of which nothing is
        known beforehand; what a diagnosis learned stays as it was learned. Raises :class:`InputError` for a name that
        the model does not know.
        """
        if not wanted:
            own = [
                each for name in self.effects if name in _OF_NO_PAPER for each in CATALOGUE[name].parameters
            ]
            known = tuple(name for name in FREE if _FREE_WITH_AN_EFFECT.get(name) in (None, *self.effects))
            return (*known, *(each.name for each in own if each.tolerance == 0.0))
        table = self.table
        for name in wanted:
            if name not in table:
                raise InputError(
                    f"there is no parameter '{name}'",
                    source="--free",
                    remedy="choose among: " + ", ".join(table),
                )
        return tuple(dict.fromkeys(wanted))

    @property
    def identified(self) -> tuple[tuple[str, ...], dict[str, float]]:
        """The parameters that a fit left free, and the values of all that it moved [SI].

        Those of the paper and the rig's own values for a drawing. Raises :class:`InputError` if the list in the rig
        file is none of known parameters.
        """
        table = self.table
        named = self.rig.provenance.get("free", self.free())
        found = _names_among(table, named)
        if not found:
            raise InputError(
                f"provenance.free is {named!r}",
                source=self.rig.source,
                remedy="list parameters of the model",
            )
        return found, {name: table[name].value for name in (*found, *self._values_before())}

    @property
    def before(self) -> "RigModel":
        """The model with the values that were known before its fit, the centres of their priors; a drawing as it is.

        Raises :class:`InputError` if the rig file's table of them is not of numbers.
        """
        before = self._values_before()
        with blamed_on(self.rig.source):
            return self.with_parameters(self.table.with_values(before)) if before else self

    def with_parameters(self, table: ParameterTable) -> "RigModel":
        """The same model with another table."""
        return replace(self, rig=replace(self.rig, parameters=table))

    def with_values(self, values: Mapping[str, float]) -> "RigModel":
        """The same model with some values replaced [SI], by name: those of no file.

        Raises :class:`InputError` for a name that the model does not know or a value outside its bounds.
        """
        rig = replace(self.rig, parameters=self.table.with_values(values), source="", sha256="")
        return replace(self, rig=rig)

    def with_provenance(self, provenance: Mapping[str, Any]) -> "RigModel":
        """The same model, which remembers the fit that its values come from."""
        return replace(self, rig=replace(self.rig, provenance=provenance))

    def origin(self, campaign: Campaign | None = None, warnings: Sequence[DataWarning] = ()) -> Origin:
        """Where results on this model come from; ``warnings`` are those beyond the campaign's own."""
        origin = Origin(model=self.rig.source, rig=self.rig.name, effects=self.effects)
        if campaign is None:
            return origin
        every = (*campaign.warnings, *warnings)
        return replace(origin, data=campaign.source, data_sha256=campaign.sha256, warnings=every)

    def _values_before(self) -> dict[str, float]:
        before = self.rig.provenance.get("before", {})
        wrong = InputError(
            "provenance.before is no table of numbers",
            source=self.rig.source,
            remedy="identify the rig again",
        )
        if not isinstance(before, Mapping) or not all(
            isinstance(each, int | float) for each in before.values()
        ):
            raise wrong
        if any(name not in self.table for name in before):
            raise wrong
        try:
            return {str(name): float(value) for name, value in before.items()}
        except OverflowError:
            raise wrong from None


def load_rig(path: str | Path | None = None) -> Rig:
    """The rig of a TOML file, or the one that comes with the package.

    Raises :class:`InputError`, with file, key, what is wrong and the remedy, for anything that is not a complete rig
    file.
    """
    return read_rig(path or default_rig_path())


ModelName = Literal["simqc", "simtr"]
"""The paper's models: the frictionless rig, and the one with friction at rail and tyre."""


def load_model(path: str | Path | None = None, effects: ModelName | Sequence[str] | None = None) -> RigModel:
    """The model of a rig file: with ``effects``, else those that it was fitted with, else those of the paper's SimTR.

    ``effects`` are names of effects, or "simqc" or "simtr" for those of the paper's models. Raises
    :class:`InputError` if the file cannot be read or what it says of effects is no list of known ones.
    """
    return model_of(load_rig(path), effects)


def load_baseline(path: str | Path | None = None, model: ModelName | None = None) -> RigModel:
    """The baseline of a diagnosis: a drawing as one of the paper's models, or an identified rig with its own effects.

    A drawing is the paper's SimTR if ``model`` is left out. Raises :class:`InputError` as :func:`load_model` does,
    and for a rig that was identified with other effects than those of ``model``.
    """
    rig = load_rig(path)
    if "effects" not in rig.provenance:
        return RigModel(rig, effects_of(model or "simtr"))
    found = model_of(rig)
    if model is not None and set(effects_of(model)) != set(found.effects):
        raise InputError(
            f"was identified with {', '.join(found.effects) or 'no friction'}, which is not {model}",
            source=rig.source,
            remedy="leave --model out, or give the drawing that the rig was identified from",
        )
    return found


def effects_of(model: str) -> tuple[str, ...]:
    """The effects of one of the paper's models; raises :class:`InputError` for another name."""
    if model not in MODELS:
        raise InputError(f"there is no model '{model}'", remedy="choose among: " + ", ".join(MODELS))
    return MODELS[model]


def model_of(rig: Rig, effects: ModelName | Sequence[str] | None = None) -> RigModel:
    """The same of a rig that was read already; raises as :func:`load_model` does."""
    if isinstance(effects, str):
        return RigModel(rig, effects_of(effects))
    if effects is not None:
        return RigModel(rig, tuple(effects))
    named = rig.provenance.get("effects", MODELS["simtr"])
    found = _names_among(EFFECTS, named)
    if found is None:
        raise InputError(
            f"provenance.effects is {named!r}",
            source=rig.source,
            remedy="list known effects: " + ", ".join(sorted(EFFECTS)),
        )
    return RigModel(rig, found)


def _names_among(known: Collection[str], named: object) -> tuple[str, ...] | None:
    """What a file names, if it is a list of what is known, nothing in it twice; else None."""
    if not isinstance(named, list | tuple) or not all(isinstance(name, str) for name in named):
        return None
    right = all(name in known for name in named) and len(set(named)) == len(named)
    return tuple(named) if right else None
