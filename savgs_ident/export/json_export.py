"""JSON: the whole identified model in one document, versioned, and described by a JSON Schema.

    {"schema": 1, "kind": "savgs_ident model", "name": ..., "effects": [...],
     "parameters": {name: {"value", "unit", "tolerance", "lower", "upper", "about", "source", "section"}},
     "damper": ..., "signals": ..., "linear_equivalent": ...,
     "covariance": ..., "samples": ..., "diagnosis": ..., "provenance": ...}

SI throughout. Reading gives back the very model that was written: the same rig, effects, draws and diagnosis. Signals
and linear equivalent follow from these; they are for readers without this package.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.effects.registry import EFFECTS
from savgs_ident.export.diagnosis_document import parse_diagnosis
from savgs_ident.export.equations import Equations, Signal, equations_of
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.json_text import Plain, as_plain, write_json_text
from savgs_ident.export.linear_models import EQUIVALENT_UNITS, equation_8, equivalent_of
from savgs_ident.export.place import Place, read_document
from savgs_ident.export.rig_document import (
    COVARIANCE,
    check_covariance,
    covariance_record,
    damper_record,
    parameters_record,
    parse_rig,
    provenance_record,
)
from savgs_ident.export.state_space_document import parse_space, space_record

SCHEMA = 1
"""The number of the form; a document with another one is refused."""

KIND = "savgs_ident model"
"""What says that a document is one of these."""

NAME = "model.json"
"""The file."""

REMEDY = "give the model.json that `savgs-ident export --to json` wrote"

_KEYS = (
    "schema", "kind", "name", "effects", "parameters", "damper", "signals", "linear_equivalent", "covariance",
    "samples", "diagnosis", "provenance",
)  # fmt: skip


def write_json(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write model.json.

    Raises :class:`InputError` if it cannot be written, or the provenance holds what JSON cannot say.
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

    Raises :class:`InputError`, with file, place and remedy, for anything else.
    """
    return read_document(Path(path), REMEDY, parse_model)


def json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of the document."""
    schema: dict[str, Any] = json.loads(
        files("savgs_ident.export").joinpath("model.schema.json").read_text("utf-8")
    )
    return schema


def parse_model(document: Place) -> ExportedModel:
    """The model of a document. Raises :class:`InputError` with the place of what is wrong."""
    fields = document.table(("schema", "kind"), free=True)
    if fields["kind"].value != KIND:
        raise fields["kind"].wrong(f"'{KIND}'")
    if fields["schema"].value != SCHEMA or isinstance(fields["schema"].value, bool):
        raise fields["schema"].wrong(f"the schema {SCHEMA}, which this version reads")
    fields = document.table(_KEYS)
    effects = fields["effects"].names(tuple(EFFECTS))
    rig = parse_rig(fields, effects)
    if fields["signals"].value != _signals(equations_of(rig, effects)):
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
    def told(signals: tuple[Signal, ...]) -> list[object]:
        return [{"name": each.name, "unit": each.unit, "about": each.about} for each in signals]

    return {
        "states": told(equations.states),
        "inputs": told(equations.inputs),
        "outputs": told(equations.outputs),
    }


def _linear_equivalent(model: ExportedModel) -> dict[str, object]:
    found = equivalent_of(model)
    numbers = {
        name: {"value": float(getattr(found, name)), "unit": unit} for name, unit in EQUIVALENT_UNITS.items()
    }
    return {**numbers, "state_space": space_record(equation_8(model))}


def _check_linear_equivalent(place: Place) -> None:
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


def _parse_samples(place: Place, model: ExportedModel) -> dict[str, NDArray[np.float64]]:
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
