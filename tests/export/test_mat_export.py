"""model.mat, read by scipy's own reader, is the model."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy.io import loadmat

from savgs_ident.control.linearisation import first_harmonic, motions_on_cam
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.values import as_values
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.linear_models import linear_models
from savgs_ident.export.mat_export import write_mat
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

pytestmark = pytest.mark.slow

FIELD = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")


@pytest.fixture(scope="module")
def path(model: ExportedModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the model with everything."""
    (written,) = write_mat(model, tmp_path_factory.mktemp("mat"))
    return written


@pytest.fixture(scope="module")
def found(path: Path) -> dict[str, Any]:
    """What scipy reads from it."""
    read: dict[str, Any] = loadmat(path, simplify_cells=True)
    return read


def test_parameters_come_with_their_units(found: dict[str, Any], model: ExportedModel) -> None:
    assert set(found["parameters"]) == set(model.table)
    for name, entry in model.table.items():
        row = found["parameters"][name]
        assert (row["value"], row["unit"]) == (entry.value, entry.unit)


def test_rig_covariance_and_draws_are_those_of_the_model(found: dict[str, Any], model: ExportedModel) -> None:
    assert (found["name"], list(found["effects"])) == (model.model.rig.name, list(model.effects))
    assert np.array_equal(found["damper"]["velocity"], model.model.rig.damper_velocity)
    assert np.array_equal(found["damper"]["force"], model.model.rig.damper_force)
    names, covariance = model.covariance
    assert list(found["covariance"]["names"]) == list(names)
    assert np.array_equal(found["covariance"]["matrix"], covariance)
    assert set(found["samples"]) == set(model.samples)
    for name, values in model.samples.items():
        assert np.array_equal(found["samples"][name], values)


def test_texts_are_json(found: dict[str, Any], model: ExportedModel) -> None:
    assert json.loads(found["diagnosis"]) == model.diagnosis
    reported = {name: value for name, value in model.model.rig.provenance.items() if name != "covariance"}
    assert json.loads(found["provenance"]) == reported


def test_the_state_spaces_make_the_same_systems(found: dict[str, Any], model: ExportedModel) -> None:
    for name, linear in linear_models(model).items():
        space = found["state_spaces"][name]
        for matrix in "ABCD":
            assert np.array_equal(space[matrix], getattr(linear.space, matrix))
        assert list(space["states"]) == linear.space.state_labels
        assert list(space["inputs"]) == linear.space.input_labels
        assert list(space["outputs"]) == linear.space.output_labels
        assert list(space["output_units"]) == [linear.units[each] for each in linear.space.output_labels]


def test_frequency_responses_are_those_of_the_state_spaces_in_the_file(found: dict[str, Any]) -> None:
    responses = found["frequency_responses"]
    frequency = responses["frequency_hz"]
    assert (frequency[0], frequency[-1]) == (pytest.approx(0.5), pytest.approx(10.0))
    for name in ("equation_8", "exact"):
        space = control.ss(*(found["state_spaces"][name][matrix] for matrix in "ABCD"))
        wanted = control.frequency_response(space, 2.0 * np.pi * frequency).complex
        assert responses[name] == pytest.approx(wanted, rel=1e-9)


def test_the_motion_on_the_cam_is_that_of_the_nonlinear_rig(
    found: dict[str, Any], model: ExportedModel
) -> None:
    on_cam = found["frequency_responses"]["on_cam"]
    assert list(on_cam["channels"]) == ["sprung_accel", "susp_deflection"]
    assert on_cam["response"].shape == (2, on_cam["frequency_hz"].size)
    at = int(np.flatnonzero(on_cam["frequency_hz"] == 2.0)[0])
    car, p = model.equations.model, as_values(model.table.as_dict())
    # Another mesh: alone, the motion at 2 Hz is found with its own number of points.
    motions = motions_on_cam(car, p, np.array([2.0]), on_cam["cam_peak_to_peak"])
    wanted = first_harmonic(car, p, motions, on_cam["cam_peak_to_peak"])[0]
    assert on_cam["response"][:, at] == pytest.approx(wanted, rel=1e-6)


def _fields(value: Any) -> list[str]:
    if not isinstance(value, dict):
        return []
    return [*value, *(inner for entry in value.values() for inner in _fields(entry))]


def test_every_field_is_a_name_to_matlab(found: dict[str, Any]) -> None:
    names = [name for name in _fields(found) if not name.startswith("__")]
    assert len(names) > 100
    assert all(FIELD.fullmatch(name) for name in names)


@pytest.mark.parametrize("name", ["end", "_a", "länge", "a" * 64])
def test_a_parameter_that_matlab_cannot_name_is_refused(rig: Rig, tmp_path: Path, name: str) -> None:
    odd = ParameterTable((*rig.parameters.entries, Parameter(name, 1.0, "m")))
    with pytest.raises(InputError, match="cannot be a field in MATLAB"):
        write_mat(ExportedModel(RigModel(replace(rig, parameters=odd), ())), tmp_path)
    assert not list(tmp_path.iterdir())


def test_long_names_are_kept(rig: Rig, tmp_path: Path) -> None:
    name = "a" * 63
    long = ParameterTable((*rig.parameters.entries, Parameter(name, 2.0, "m")))
    (path,) = write_mat(ExportedModel(RigModel(replace(rig, parameters=long), ())), tmp_path)
    assert loadmat(path, simplify_cells=True)["parameters"][name]["value"] == 2.0


def test_a_drawing_has_nothing_of_a_fit(rig: Rig, tmp_path: Path) -> None:
    (path,) = write_mat(ExportedModel(RigModel(rig, ())), tmp_path)
    found = loadmat(path, simplify_cells=True)
    assert np.size(found["covariance"]["matrix"]) == 0
    assert found["samples"] == {}
    assert (np.size(found["diagnosis"]), np.size(found["effects"])) == (0, 0)


def test_the_same_model_gives_the_same_bytes(model: ExportedModel, path: Path, tmp_path: Path) -> None:
    (again,) = write_mat(model, tmp_path)
    assert again.read_bytes() == path.read_bytes()
    assert path.read_bytes().startswith(b"MATLAB 5.0 MAT-file")
