"""MATLAB: model.mat, version 5, for MATLAB, Octave and scipy.io.loadmat.

    model = load('model.mat');
    sys = ss(model.state_spaces.exact.A, ...);
    model.parameters.k_t.value                          % SI, the unit beside it
    model.frequency_responses.exact(1, 1, :)            % outputs x inputs x frequencies

Nested records (a diagnosis, the provenance) are JSON: jsondecode(model.diagnosis).
"""

import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import control
import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from savgs_ident.control.linear_study import CHANNELS, FREQUENCY, TEST_FREQUENCY
from savgs_ident.control.linearisation import first_harmonic, motions_on_cam
from savgs_ident.core.errors import InputError
from savgs_ident.core.files import write_bytes
from savgs_ident.core.values import as_values
from savgs_ident.export.document import as_plain, json_text
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.json_export import covariance_record, provenance_record
from savgs_ident.export.linear_models import LinearModel, linear_models
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.quarter_car.model import RigModel

NAME = "model.mat"
"""The name of the file."""

LONGEST_NAME = 63
"""Characters of a name in MATLAB."""

KEYWORDS = frozenset(
    {
        "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
        "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
    }
)  # fmt: skip
"""Reserved words of MATLAB."""

DECADE = 10.0
"""Ratio by which responses are given beyond the typical frequencies of a plant [1]."""

COUNT = 81
"""Number of their frequencies."""

_HEAD = b"MATLAB 5.0 MAT-file, written by savgs_ident"
_HEAD_BYTES = 116


def write_mat(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write model.mat.

    Raises :class:`InputError` if it cannot be written, a parameter's name is invalid in MATLAB, or the plant has no
    rest or, for the rig, no motion on the cam.
    """
    stream = io.BytesIO()
    savemat(stream, mat_record(model), long_field_names=True, do_compression=True, oned_as="column")
    # SciPy's header contains the date; the same model must give the same bytes.
    content = _HEAD.ljust(_HEAD_BYTES) + stream.getvalue()[_HEAD_BYTES:]
    return (write_bytes(folder / NAME, content),)


def mat_record(model: ExportedModel) -> dict[str, object]:
    """The variables of the file: numbers as arrays, lists of names as cells."""
    car, equations = model.quarter_car, model.equations
    covariance_record(model)  # Raises for an invalid one.
    names, covariance = model.covariance
    parameters = {
        _field(entry.name): {"value": entry.value, "unit": entry.unit, "about": entry.about}
        for entry in model.table.entries
    }
    linear = linear_models(model)
    return {
        "schema": 1.0,
        "name": model.model.plant_name,
        "effects": _cell(model.effects),
        "parameters": parameters,
        **({} if car is None else {"damper": _damper(car)}),
        "signals": {
            "states": _cell(signal.name for signal in equations.states),
            "inputs": _cell(signal.name for signal in equations.inputs),
            "outputs": _cell(signal.name for signal in equations.outputs),
        },
        "covariance": {"names": _cell(names), "matrix": covariance},
        "samples": {_field(name): values for name, values in model.samples.items()},
        "state_spaces": {name: _space(each) for name, each in linear.items()},
        "frequency_responses": _responses(model, linear),
        "diagnosis": _json(as_plain(dict(model.diagnosis), "diagnosis")),
        "provenance": _json(provenance_record(model)),
    }


def _damper(model: RigModel) -> dict[str, object]:
    rig = model.rig
    return {"velocity": np.array(rig.damper_velocity), "force": np.array(rig.damper_force)}


def _responses(model: ExportedModel, linear: Mapping[str, LinearModel]) -> dict[str, object]:
    """Frequency responses of the linear models and, of the rig, the nonlinear one's on its cam."""
    car = model.quarter_car
    frequency = frequencies(model.plant) if car is None else FREQUENCY
    responses = {name: each.response(frequency) for name, each in linear.items()}
    on_cam = {} if car is None else {"on_cam": _on_cam(car)}
    return {"frequency_hz": frequency, **responses, **on_cam}


def frequencies(plant: AbstractPlant) -> NDArray[np.float64]:
    """Frequencies [Hz], (F,), about those of the typical motion of the plant's coordinates."""
    typical = [each.rate_size / each.size / (2.0 * np.pi) for each in plant.coordinates]
    return np.geomspace(min(typical) / DECADE, max(typical) * DECADE, COUNT)


def _on_cam(model: RigModel) -> dict[str, object]:
    """First harmonics of the nonlinear rig on the cam of the test, per metre of road, all effects included."""
    nonlinear, p = model.build(), as_values(model.table.as_dict())
    cam = model.table["cam_peak_to_peak"].value
    motions = motions_on_cam(nonlinear, p, TEST_FREQUENCY, cam)
    return {
        "about": "first harmonics of the nonlinear model, friction included, per metre of road",
        "frequency_hz": TEST_FREQUENCY,
        "channels": _cell(CHANNELS),
        "cam_peak_to_peak": cam,
        "response": first_harmonic(nonlinear, p, motions, cam).T,
    }


def _space(linear: LinearModel) -> dict[str, object]:
    space: control.StateSpace = linear.space
    named = {
        "states": space.state_labels,
        "inputs": space.input_labels,
        "outputs": space.output_labels,
    }
    units = {
        f"{kind[:-1]}_units": _cell(linear.units[name] for name in names) for kind, names in named.items()
    }
    cells = {kind: _cell(names) for kind, names in named.items()}
    matrices = {"A": space.A, "B": space.B, "C": space.C, "D": space.D}
    return {"about": linear.about, **matrices, **cells, **units}


def _field(name: str) -> str:
    """The name, if it is valid in MATLAB."""
    usual = name.isascii() and name.isidentifier() and not name.startswith("_")
    if usual and len(name) <= LONGEST_NAME and name not in KEYWORDS:
        return name
    raise InputError(
        f"the parameter '{name}' cannot be a field in MATLAB",
        source="--to mat",
        remedy=f"rename it: a letter, then letters, digits and underscores, {LONGEST_NAME} at most, no keyword",
    )


def _cell(names: Iterable[str]) -> NDArray[np.object_]:
    found = list(names)
    cell = np.empty((len(found), 1), dtype=object)
    cell[:, 0] = found
    return cell


def _json(record: object) -> str:
    return json_text(record) if record else ""
