"""The model that the public calls take: a plant with its parameters, and the effects that act on it.

    model = PlantModel(TwoMass(), TwoMass.parameters) + "guide_coulomb"
    fit = fit_response(model, measured)
    fit.model.table["k"].value

:class:`Model` is what a fit, a posterior or a diagnosis asks of one; :class:`PlantModel` is that of any plant, and
the quarter car has its own, with a rig file (:mod:`savgs_ident.plants.quarter_car.model`).
"""

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any, Protocol, Self

from savgs_ident.core.errors import DataWarning, InputError, blamed_on
from savgs_ident.core.parameter import SIZED, TYPICAL, Parameter, ParameterTable, merge_parameters
from savgs_ident.core.presentation import Origin
from savgs_ident.effects.base import Port
from savgs_ident.effects.effect import Effect, generic_effects
from savgs_ident.plants.base import AbstractPlant, Channel, scale_of_time
from savgs_ident.plants.layout import layout_of
from savgs_ident.plants.time_scale import time_scale_of
from savgs_ident.recordings.recording import Campaign, RecordingLayout


class Model(Protocol):
    """A plant with its parameters and effects, and what an earlier fit did to it; frozen."""

    @property
    def name(self) -> str:
        """Its name in files and reports."""

    @property
    def plant_name(self) -> str:
        """The name of the plant that it is a model of."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in it."""

    @property
    def plant(self) -> AbstractPlant | type[AbstractPlant]:
        """What the plant declares: coordinates, inputs, channels, ports."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What the plant's sensors read."""

    @property
    def catalogue(self) -> Mapping[str, Effect]:
        """The effects, by name, that it may have."""

    @property
    def candidates(self) -> Mapping[str, Effect]:
        """The effects, by name, that a diagnosis looks for."""

    @property
    def known_models(self) -> tuple[tuple[str, ...], ...]:
        """Sets of effects, by name, that such plants are known to have together."""

    @property
    def table(self) -> ParameterTable:
        """All parameters, those of the plant and those that its effects bring along."""

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Where its numbers come from; empty for a drawing."""

    @property
    def source(self) -> str:
        """The file that its numbers come from; empty without one."""

    @property
    def sha256(self) -> str:
        """A digest of its numbers, by which an earlier run on the same is recognised."""

    @property
    def is_drawing(self) -> bool:
        """Whether it comes from no fit."""

    def __add__(self, effect: Any) -> Self:
        """The same model with one more effect, by its name in the catalogue."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why its values are not to be trusted, a sentence each; empty if they are."""

    @property
    def identified(self) -> tuple[tuple[str, ...], dict[str, float]]:
        """The parameters that a fit left free, and the values of all that it moved [SI]."""

    @property
    def before(self) -> Self:
        """The model with the values that were known before its fit, the centres of their priors."""

    @property
    def layout(self) -> RecordingLayout:
        """The channels that its recordings have, for ``savgs_ident.load_campaign``."""

    def build(self) -> AbstractPlant:
        """The plant that solvers take, with its effects."""

    def free(self, wanted: Sequence[str] = ()) -> tuple[str, ...]:
        """The parameters to identify: those ``wanted``, or what the model identifies by itself."""

    def with_parameters(self, table: ParameterTable) -> Self:
        """The same model with another table."""

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same model with some values replaced [SI], by name."""

    def with_provenance(self, provenance: Mapping[str, Any]) -> Self:
        """The same model, which remembers the fit that its values come from."""

    def origin(self, campaign: Campaign | None = None, warnings: Sequence[DataWarning] = ()) -> Origin:
        """Where results on this model come from; ``warnings`` are those beyond the campaign's own."""


@dataclass(frozen=True)
class PlantModel:
    """A plant with its parameters.

    Attributes:
        plant: the plant, with the effects that it has.
        parameters: its parameters, SI, with bounds and tolerances.
        catalogue: the effects, by name, that it may have; every law at every port that it suits, if left out.
        provenance: what a fit did: the parameters left ``free``, and the values ``before`` of all that it moved.
        source: the file that its numbers come from; empty without one.

    ``model + "guide_coulomb"`` is the model with one more effect of the catalogue, ``model + effect`` with one of
    your own. Raises :class:`InputError` for an effect that is not in the catalogue, or whose parameters do not go
    with those of the plant.
    """

    plant: AbstractPlant
    parameters: ParameterTable
    catalogue: Mapping[str, Effect] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if self.plant.time_scale is None:
            object.__setattr__(self, "plant", replace(self.plant, time_scale=self._time_scale()))
        if not self.catalogue:
            # As a dictionary, for a view of one cannot be sent to another process.
            object.__setattr__(self, "catalogue", dict(generic_effects(self.plant.scaled_ports)))
        _ = self.table

    def __add__(self, effect: str | Effect) -> "PlantModel":
        """The model with one more effect; the same model if it is there already."""
        if isinstance(effect, str):
            if effect not in self.catalogue:
                raise InputError(
                    f"there is no effect '{effect}'",
                    remedy="choose among: " + ", ".join(sorted(self.catalogue)),
                )
            effect = self.catalogue[effect]
        if effect.name in self.effects:
            return self
        effect = effect.sized(replace(effect.port, time_scale=scale_of_time(self.plant)))
        catalogue = {**self.catalogue, effect.name: effect}
        return replace(self, plant=self.plant + effect, catalogue=catalogue)

    def _time_scale(self) -> float:
        # What is wrong with a user's equations is told where they are solved, and by check-plant.
        with suppress(Exception):
            return time_scale_of(replace(self.plant, effects=()), self.parameters.as_dict())
        return 1.0

    def __str__(self) -> str:
        return " + ".join((self.name, *self.effects))

    @property
    def name(self) -> str:
        """The name of the plant."""
        return self.plant_name

    @property
    def plant_name(self) -> str:
        """The name of the plant's class."""
        return type(self.plant).__name__

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in it."""
        return tuple(effect.name for effect in self.plant.effects)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What the plant's sensors read."""
        return self.plant.channels

    @property
    def candidates(self) -> Mapping[str, Effect]:
        """The effects, by name, that a diagnosis looks for: all that the model may have."""
        return self.catalogue

    @property
    def known_models(self) -> tuple[tuple[str, ...], ...]:
        """No sets of effects: nothing is known of such plants."""
        return ()

    @property
    def table(self) -> ParameterTable:
        """All parameters, those of the plant and those that its effects bring along."""
        brought = (ParameterTable(effect.parameters) for effect in self.plant.effects)
        return merge_parameters(self.parameters, *brought)

    @property
    def is_drawing(self) -> bool:
        """Whether it comes from no fit."""
        return not self.provenance

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why its values are not to be trusted, a sentence each; empty if they are."""
        return doubts_of_fit(self.source or self.name, self.provenance)

    @property
    def sha256(self) -> str:
        """A digest of the plant's class and of all numbers."""
        what = f"{type(self.plant).__qualname__}\n{self.table.entries}\n{dict(self.provenance)}"
        return hashlib.sha256(what.encode()).hexdigest()

    @property
    def layout(self) -> RecordingLayout:
        """The channels that recordings of the plant have: its inputs, then what its sensors read."""
        return layout_of(self.plant)

    def build(self) -> AbstractPlant:
        """The plant that solvers take, with its effects."""
        return self.plant

    def free(self, wanted: Sequence[str] = ()) -> tuple[str, ...]:
        """The parameters to identify: those ``wanted``, or all of which nothing is known but two bounds.

        Raises :class:`InputError` for a name that the model does not know, and if nothing is left to identify.
        """
        table = self.table
        for name in wanted:
            if name not in table:
                raise InputError(
                    f"there is no parameter '{name}'", remedy="choose among: " + ", ".join(table)
                )
        found = tuple(dict.fromkeys(wanted)) or tuple(each.name for each in table.entries if _open(each))
        if not found:
            raise InputError(
                "no parameter is known to two bounds and without a tolerance",
                remedy="name the parameters to identify",
            )
        return found

    def sized(self, ports: Mapping[str, Port]) -> "PlantModel":
        """The model with typical numbers in its effects for other typical sizes at its ports.

        ``ports`` have these sizes, by name. Stiffness and damping of a contact follow the force where they are but
        typical numbers.
        """

        def sized(effect: Effect) -> Effect:
            return effect.sized(ports[effect.port.name]) if effect.port.name in ports else effect

        catalogue = {name: sized(effect) for name, effect in self.catalogue.items()}
        plant = replace(self.plant, effects=tuple(sized(effect) for effect in self.plant.effects))
        ratios = {
            name: ports[port.name].force / port.force
            for port in self.plant.ports
            if port.contact is not None and port.name in ports
            for name in port.contact
        }
        brought = {
            old: new
            for name, effect in self.catalogue.items()
            for old, new in zip(effect.parameters, catalogue[name].parameters, strict=True)
        }
        # A table that was set as a whole has the parameters of effects, too.
        known = (brought.get(each, each) for each in self.parameters.entries)
        resized = ParameterTable(tuple(_times(each, ratios.get(each.name, 1.0)) for each in known))
        return replace(self, plant=plant, parameters=resized, catalogue=catalogue)

    @property
    def identified(self) -> tuple[tuple[str, ...], dict[str, float]]:
        """The parameters that a fit left free, and the values of all that it moved [SI]."""
        table = self.table
        free = tuple(self.provenance.get("free", ())) or self.free()
        moved = (*free, *self.provenance.get("before", {}))
        return free, {name: table[name].value for name in moved}

    @property
    def before(self) -> "PlantModel":
        """The model with the values that were known before its fit, the centres of their priors."""
        with blamed_on(self.source):
            return self.with_values(self.provenance.get("before", {}))

    def with_parameters(self, table: ParameterTable) -> "PlantModel":
        """The same model with another table."""
        return replace(self, parameters=table)

    def with_values(self, values: Mapping[str, float]) -> "PlantModel":
        """The same model with some values replaced [SI], by name.

        Raises :class:`InputError` for a name that the model does not know or a value outside its bounds.
        """
        return self.with_parameters(self.table.with_values(values))

    def with_provenance(self, provenance: Mapping[str, Any]) -> "PlantModel":
        """The same model, which remembers the fit that its values come from."""
        return replace(self, provenance=provenance)

    def origin(self, campaign: Campaign | None = None, warnings: Sequence[DataWarning] = ()) -> Origin:
        """Where results on this model come from; ``warnings`` are those beyond the campaign's own."""
        origin = Origin(model=self.source, rig=self.name, effects=self.effects, warnings=tuple(warnings))
        if campaign is None:
            return origin
        every = (*campaign.warnings, *warnings)
        return replace(origin, data=campaign.source, data_sha256=campaign.sha256, warnings=every)


def _times(number: Parameter, ratio: float) -> Parameter:
    """A typical number that is so many times as large; any other as it is."""
    if number.source != TYPICAL:
        return number
    return replace(
        number,
        value=number.value * ratio,
        tolerance=number.tolerance * ratio,
        lower=number.lower * ratio,
        upper=number.upper * ratio,
        source=SIZED,
    )


def doubts_of_fit(name: str, provenance: Mapping[str, Any]) -> tuple[str, ...]:
    """Why the fit that made a model, by its provenance, is not to be trusted; empty if it is, or there was none."""
    if provenance.get("trusted", True):
        return ()
    why = provenance.get("doubt", provenance.get("status", "no status"))
    return (f"{name}: its own fit is not to be trusted ({why}).",)


def _open(each: Parameter) -> bool:
    """Whether nothing is known of a parameter but two bounds."""
    bounded = isfinite(each.lower) and isfinite(each.upper)
    return bounded and each.tolerance == 0.0 and each.lower < each.value < each.upper
