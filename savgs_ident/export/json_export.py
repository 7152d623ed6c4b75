"""JSON: the whole identified model in one document, versioned, and described by a JSON Schema.

    {"schema": 1, "kind": "savgs_ident model", "name": ..., "effects": [...],
     "parameters": {name: {"value", "unit", "tolerance", "lower", "upper", "about", "source", "section"}},
     "damper": ..., "signals": ..., "linear_equivalent": ...,
     "covariance": ..., "samples": ..., "diagnosis": ..., "provenance": ...}

SI throughout. Reading returns the model that was written: the same rig, effects, draws and diagnosis. Signals and
linear equivalent follow from these; they are for readers without this package.

Every parameter has the section of the rig file that it belongs to; ``catalogue`` are those that the rig file does not
have, which an effect of the model adds with their usual values. What is read passes the checks of a rig file.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from importlib.resources import files
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter
from savgs_ident.export.document import JsonValue, Plain, as_plain, read_document, write_json_text
from savgs_ident.export.exported_model import Equations, ExportedModel, Signal, build_equations
from savgs_ident.export.gather import parse_diagnosis
from savgs_ident.export.linear_models import (
    EQUIVALENT_UNITS,
    equation_8,
    linear_equivalent,
    parse_space,
    space_record,
)
from savgs_ident.plants.quarter_car.catalogue import EFFECTS, build_model, model_parameters
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_toml import (
    DAMPER_SECTION,
    DAMPER_UNITS,
    EXTRA_SECTION,
    SECTION_OF,
    SECTIONS,
    parse_damper,
    parse_name,
    parse_parameters,
)
from savgs_ident.plants.quarter_car.rig_toml import SCHEMA as RIG_SCHEMA

SCHEMA = 1
"""The version of the document; another one is refused."""
KIND = "savgs_ident model"
"""Identifies the document."""
NAME = "model.json"
"""The name of the file."""
REMEDY = "give the model.json that `savgs-ident export --to json` wrote"
_KEYS = (
    "schema", "kind", "name", "effects", "parameters", "damper", "signals", "linear_equivalent", "covariance",
    "samples", "diagnosis", "provenance",
)  # fmt: skip


def write_json(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write model.json.

    Raises :class:`InputError` if it cannot be written, or the provenance holds what JSON cannot represent.
    """
    return (write_json_text(folder / NAME, model_record(model)),)


def model_record(model: ExportedModel) -> dict[str, object]:
    """The document, of plain values."""
    return {
        "schema": SCHEMA,
        "kind": KIND,
        "name": model.rig.name,
        "effects": list(model.effects),
        "parameters": parameters_record(model),
        "damper": damper_record(model.rig),
        "signals": _signals(model.equations),
        "linear_equivalent": _linear_equivalent(model),
        "covariance": covariance_record(model),
        "samples": _samples(model.samples),
        "diagnosis": as_plain(dict(model.diagnosis), "diagnosis") or None,
        "provenance": provenance_record(model.rig),
    }


def read_model_json(path: str | Path) -> ExportedModel:
    """The model in a document that :func:`write_json` wrote.

    Raises :class:`InputError`, with file, place and remedy, for any other document.
    """
    return read_document(Path(path), REMEDY, parse_model)


def json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of the document."""
    schema: dict[str, Any] = json.loads(
        files("savgs_ident.export").joinpath("model.schema.json").read_text("utf-8")
    )
    return schema


def parse_model(document: JsonValue) -> ExportedModel:
    """The model of a document. Raises :class:`InputError` with the place of the error."""
    fields = document.table(("schema", "kind"), free=True)
    if fields["kind"].value != KIND:
        raise fields["kind"].wrong(f"'{KIND}'")
    if fields["schema"].value != SCHEMA or isinstance(fields["schema"].value, bool):
        raise fields["schema"].wrong(f"the schema {SCHEMA}, which this version reads")
    fields = document.table(_KEYS)
    effects = fields["effects"].names(tuple(EFFECTS))
    rig = parse_rig(fields, effects)
    if fields["signals"].value != _signals(
        build_equations(build_model(rig, effects), model_parameters(rig, effects))
    ):
        raise InputError(
            "signals are not those of the effects in this version", remedy="export the model again"
        )
    _check_linear_equivalent(fields["linear_equivalent"])
    model = ExportedModel(rig, effects)
    if fields["covariance"].value is not None:
        check_covariance(fields["covariance"], model)
        rig = replace(rig, provenance={**rig.provenance, COVARIANCE: fields["covariance"].value})
    samples = {} if fields["samples"].value is None else _parse_samples(fields["samples"], model)
    diagnosis = {} if fields["diagnosis"].value is None else parse_diagnosis(fields["diagnosis"])
    return ExportedModel(rig, effects, samples, diagnosis)


def _signals(equations: Equations) -> dict[str, object]:
    def records(signals: tuple[Signal, ...]) -> list[object]:
        return [{"name": each.name, "unit": each.unit, "about": each.about} for each in signals]

    return {
        "states": records(equations.states),
        "inputs": records(equations.inputs),
        "outputs": records(equations.outputs),
    }


def _linear_equivalent(model: ExportedModel) -> dict[str, object]:
    found = linear_equivalent(model)
    numbers = {
        name: {"value": float(getattr(found, name)), "unit": unit} for name, unit in EQUIVALENT_UNITS.items()
    }
    return {**numbers, "state_space": space_record(equation_8(model))}


def _check_linear_equivalent(place: JsonValue) -> None:
    fields = place.table((*EQUIVALENT_UNITS, "state_space"))
    for name, unit in EQUIVALENT_UNITS.items():
        number = fields[name].table(("value", "unit"))
        number["value"].number()
        number["unit"].text((unit,))
    parse_space(fields["state_space"], "equation_8")


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


CATALOGUE_SECTION = "catalogue"
"""The section of parameters that the rig file does not carry."""
COVARIANCE = "covariance"
"""The entry of the provenance that has a place of its own in the document."""
_NUMBERS = ("value", "tolerance", "lower", "upper")
_TEXTS = ("unit", "about", "source")
_BOUNDS = ("lower", "upper")
_SECTIONS = (*SECTIONS, EXTRA_SECTION, CATALOGUE_SECTION)


def parameters_record(model: ExportedModel) -> dict[str, object]:
    """All parameters of the model by name; an absent bound is null."""
    return {entry.name: _parameter_record(model.rig, entry) for entry in model.table.entries}


def damper_record(rig: Rig) -> dict[str, object]:
    """The damper table: force over velocity, compression positive, before its scale c_sd."""
    columns = {"velocity": rig.damper_velocity, "force": rig.damper_force}
    return {name: {"unit": DAMPER_UNITS[name], "values": list(column)} for name, column in columns.items()}


def provenance_record(rig: Rig) -> dict[str, Plain]:
    """The origin of the numbers, except their covariance.

    Raises :class:`InputError` for what JSON cannot represent.
    """
    return {
        name: as_plain(value, f"provenance.{name}")
        for name, value in rig.provenance.items()
        if name != COVARIANCE
    }


def covariance_record(model: ExportedModel) -> Plain:
    """Names and covariance of the estimated parameters; null for a drawing.

    Raises :class:`InputError` if it is not one of the rig's parameters.
    """
    if COVARIANCE not in model.rig.provenance:
        return None
    plain = as_plain(model.rig.provenance[COVARIANCE], "provenance.covariance")
    check_covariance(JsonValue(plain, "provenance.covariance"), model)
    return plain


def check_covariance(place: JsonValue, model: ExportedModel) -> None:
    """Raises :class:`InputError` unless it is a covariance of the model's parameters."""
    fields = place.table(("names", "matrix"))
    names = fields["names"].names(tuple(model.table))
    fields["matrix"].matrix(len(names), len(names))


def parse_rig(fields: dict[str, JsonValue], effects: tuple[str, ...]) -> Rig:
    """The rig of the document's ``fields``, without covariance.

    Raises :class:`InputError` for an invalid rig, or other parameters than those of the model with ``effects``.
    """
    rows = {
        name: place.table((*_NUMBERS, *_TEXTS, "section"))
        for name, place in fields["parameters"].entries().items()
    }
    document: dict[str, object] = {
        "schema": RIG_SCHEMA,
        "name": fields["name"].text(),
        DAMPER_SECTION: _damper(fields["damper"]),
    }
    sections: dict[str, dict[str, object]] = {key: {} for key in SECTIONS}
    for name, row in rows.items():
        section = row["section"].text(_SECTIONS)
        if section != CATALOGUE_SECTION:
            sections.setdefault(section, {})[name] = _fields(row)
    provenance = {name: place.value for name, place in fields["provenance"].entries().items()}
    document |= sections
    rig = Rig(parse_name(document), parse_parameters(document), *parse_damper(document), provenance)
    _check_parameters(ExportedModel(rig, effects), rows)
    return rig


def _parameter_record(rig: Rig, entry: Parameter) -> dict[str, object]:
    usual = SECTION_OF.get(entry.name, EXTRA_SECTION)
    bounds = {name: value if isfinite(value := getattr(entry, name)) else None for name in _BOUNDS}
    section = usual if entry.name in rig.parameters else CATALOGUE_SECTION
    fields = {name: value for name, value in asdict(entry).items() if name != "name"}
    return fields | bounds | {"section": section}


def _fields(row: dict[str, JsonValue]) -> dict[str, object]:
    """A row as a rig file has it: an absent bound is left out."""
    numbers = {
        name: row[name].number() for name in _NUMBERS if name not in _BOUNDS or row[name].value is not None
    }
    return numbers | {name: row[name].text() for name in _TEXTS}


def _damper(place: JsonValue) -> dict[str, object]:
    columns: dict[str, object] = {}
    for name, column in place.table(tuple(DAMPER_UNITS)).items():
        fields = column.table(("unit", "values"))
        columns[name] = {"unit": fields["unit"].text(), "values": fields["values"].vector().tolist()}
    return columns


def _check_parameters(model: ExportedModel, rows: dict[str, dict[str, JsonValue]]) -> None:
    """The rows are the model's parameters, and those of the catalogue have the values of this version."""
    expected = parameters_record(model)
    for name in expected:
        if name not in rows:
            raise InputError(f"parameters.{name} is missing")
    for name, row in rows.items():
        if name not in expected:
            raise InputError(f"parameters.{name} belongs to no effect of the model")
        found = {field: place.value for field, place in row.items()}
        if row["section"].value == CATALOGUE_SECTION and found != expected[name]:
            raise InputError(f"parameters.{name} is another than this version's catalogue has")
