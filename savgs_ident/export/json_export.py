"""JSON: the whole identified model in one document, versioned, and described by a JSON Schema.

    {"schema": 1, "kind": "savgs_ident plant model", "plant": ..., "effects": [...],
     "parameters": {name: {"value", "unit", "tolerance", "lower", "upper", "about", "source"}},
     "signals": ..., "covariance": ..., "samples": ..., "diagnosis": ..., "provenance": ...}

SI throughout; the schema is ``plant_model.schema.json``. A model of the quarter car is of the kind
``savgs_ident model``, described by ``model.schema.json``, and holds its rig file beside
(:mod:`savgs_ident.export.rig_document`):

    {"schema": 1, "kind": "savgs_ident model", "name": ..., "parameters": {name: {..., "section"}}, ...,
     "damper": ..., "linear_equivalent": ...}

Reading returns the model that was written: the same parameters, effects, draws and diagnosis. Signals follow from
these; they are for readers without this package. A document names its plant but holds no equations: reading a model
of another plant than the quarter car takes a model of that plant.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.export.document import (
    JsonValue,
    Plain,
    as_plain,
    parameter_record,
    parse_parameter,
    read_document,
    write_json_text,
)
from savgs_ident.export.exported_model import Equations, ExportedModel, Signal, with_effects
from savgs_ident.export.gather import parse_diagnosis
from savgs_ident.export.rig_document import (
    check_linear_equivalent,
    parse_rig,
    rig_entries,
)
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.catalogue import EFFECTS
from savgs_ident.plants.quarter_car.model import RigModel

SCHEMA = 1
"""The version of both documents; another one is refused."""
RIG_KIND = "savgs_ident model"
"""Identifies the document of a quarter car."""
PLANT_KIND = "savgs_ident plant model"
"""Identifies that of another plant."""
NAME = "model.json"
"""The name of the file."""
REMEDY = "give the model.json that `savgs-ident export --to json` wrote"
COVARIANCE = "covariance"
"""The entry of the provenance that has a place of its own in the document."""
_RIG_KEYS = (
    "schema", "kind", "name", "effects", "parameters", "damper", "signals", "linear_equivalent", COVARIANCE,
    "samples", "diagnosis", "provenance",
)  # fmt: skip
_PLANT_KEYS = (
    "schema", "kind", "plant", "effects", "parameters", "signals", COVARIANCE, "samples", "diagnosis", "provenance",
)  # fmt: skip


def write_json(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write model.json.

    Raises :class:`InputError` if it cannot be written, or the provenance holds what JSON cannot represent.
    """
    return (write_json_text(folder / NAME, model_record(model)),)


def model_record(model: ExportedModel) -> dict[str, object]:
    """The document, of plain values."""
    car = model.quarter_car
    of_any_plant = {
        "schema": SCHEMA,
        "effects": list(model.effects),
        "signals": _signals(model.equations),
        COVARIANCE: covariance_record(model),
        "samples": _samples(model.samples),
        "diagnosis": as_plain(dict(model.diagnosis), "diagnosis") or None,
        "provenance": provenance_record(model),
    }
    found = of_any_plant | (
        _plant_entries(model.model) if car is None else {"kind": RIG_KIND, **rig_entries(car)}
    )
    return {key: found[key] for key in (_PLANT_KEYS if car is None else _RIG_KEYS)}


def _plant_entries(model: Model) -> dict[str, object]:
    parameters = {entry.name: parameter_record(entry) for entry in model.table.entries}
    return {"kind": PLANT_KIND, "plant": model.plant_name, "parameters": parameters}


def read_model_json(path: str | Path, model: Model | None = None) -> ExportedModel:
    """The model in a document that an export to "json" wrote.

    Args:
        path: the model.json.
        model: for a plant other than the quarter car, a model of it, which gets the values of the document.

    Raises :class:`InputError`, with file, place and remedy, for any other document.
    """
    return read_document(Path(path), REMEDY, lambda document: parse_model(document, model))


def parse_model(document: JsonValue, known: Model | None = None) -> ExportedModel:
    """The model of a document; ``known`` is one of its plant, if that is not the quarter car.

    Raises :class:`InputError` with the place of the error.
    """
    fields = document.table(("schema", "kind"), free=True)
    if fields["kind"].value not in (RIG_KIND, PLANT_KIND):
        raise fields["kind"].wrong(f"'{RIG_KIND}' or '{PLANT_KIND}'")
    if fields["schema"].value != SCHEMA or isinstance(fields["schema"].value, bool):
        raise fields["schema"].wrong(f"the schema {SCHEMA}, which this version reads")
    if fields["kind"].value == RIG_KIND:
        fields = document.table(_RIG_KEYS)
        model: Model = _parse_rig_model(fields)
    else:
        fields = document.table(_PLANT_KEYS)
        model = _parse_plant_model(fields, known)
    bare = ExportedModel(model)
    if fields["signals"].value != _signals(bare.equations):
        raise InputError(
            "signals are not those of the effects in this version", remedy="export the model again"
        )
    if fields[COVARIANCE].value is not None:
        check_covariance(fields[COVARIANCE], bare)
        model = model.with_provenance({**model.provenance, COVARIANCE: fields[COVARIANCE].value})
    samples = {} if fields["samples"].value is None else _parse_samples(fields["samples"], bare)
    diagnosis = {} if fields["diagnosis"].value is None else parse_diagnosis(fields["diagnosis"], model)
    return ExportedModel(model, samples, diagnosis)


def _parse_rig_model(fields: dict[str, JsonValue]) -> RigModel:
    effects = fields["effects"].names(tuple(EFFECTS))
    rig = parse_rig(fields, effects)
    check_linear_equivalent(fields["linear_equivalent"])
    return RigModel(rig, effects)


def _parse_plant_model(fields: dict[str, JsonValue], known: Model | None) -> Model:
    name = fields["plant"].text()
    if known is None or known.plant_name != name:
        raise InputError(f"plant is '{name}'", remedy=f"give a model of {name} to the call, too")
    effects = fields["effects"].names()
    model = with_effects(known, tuple(each for each in effects if each not in known.effects))
    if model.effects != effects:
        raise InputError(
            "effects are others than those of the model that was given", remedy="give a model without effects"
        )
    rows, table = fields["parameters"].table(tuple(model.table)), model.table
    read = ParameterTable(tuple(parse_parameter(rows[entry.name], entry) for entry in table.entries))
    provenance = {entry: place.value for entry, place in fields["provenance"].entries().items()}
    return model.with_parameters(read).with_provenance(provenance)


def _signals(equations: Equations) -> dict[str, object]:
    def records(signals: tuple[Signal, ...]) -> list[object]:
        return [{"name": each.name, "unit": each.unit, "about": each.about} for each in signals]

    return {
        "states": records(equations.states),
        "inputs": records(equations.inputs),
        "outputs": records(equations.outputs),
    }


def _samples(samples: Mapping[str, NDArray[np.float64]]) -> Plain:
    if not samples:
        return None
    draws: dict[str, object] = {name: as_plain(values, f"samples.{name}") for name, values in samples.items()}
    return {"count": len(next(iter(samples.values()))), "draws": draws}


def _parse_samples(place: JsonValue, model: ExportedModel) -> dict[str, NDArray[np.float64]]:
    fields = place.table(("count", "draws"))
    count, draws = fields["count"], fields["draws"].entries()
    found = {}
    for name, entry in draws.items():
        if name not in model.table:
            raise InputError(f"{entry.where} is no parameter of the model")
        found[name] = entry.vector()
        if found[name].size != count.value or isinstance(count.value, bool):
            raise count.wrong(f"the number of draws of '{name}'")
    if not found or count.value == 0:
        raise place.wrong("draws of parameters")
    return found


def provenance_record(model: ExportedModel) -> dict[str, Plain]:
    """The origin of the numbers, except their covariance.

    Raises :class:`InputError` for what JSON cannot represent.
    """
    return {
        name: as_plain(value, f"provenance.{name}")
        for name, value in model.model.provenance.items()
        if name != COVARIANCE
    }


def covariance_record(model: ExportedModel) -> Plain:
    """Names and covariance of the estimated parameters; null for a drawing.

    Raises :class:`InputError` if it is not one of the model's parameters.
    """
    if COVARIANCE not in model.model.provenance:
        return None
    plain = as_plain(model.model.provenance[COVARIANCE], "provenance.covariance")
    check_covariance(JsonValue(plain, "provenance.covariance"), model)
    return plain


def check_covariance(place: JsonValue, model: ExportedModel) -> None:
    """Raises :class:`InputError` unless it is a covariance of the model's parameters."""
    fields = place.table(("names", "matrix"))
    names = fields["names"].names(tuple(model.table))
    fields["matrix"].matrix(len(names), len(names))
