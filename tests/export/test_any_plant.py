"""Exports of other plants than the quarter car are the plant: closed form, equations, motions, round trips."""

import ctypes
import json
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import casadi as ca
import control
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from jsonschema import Draft202012Validator
from referencing import Registry, Resource
from scipy.io import loadmat
from scipy.linalg import expm

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import InputSignal
from savgs_ident.export.casadi_export import STEM
from savgs_ident.export.exported_model import ExportedModel, resting_inputs, resting_state
from savgs_ident.export.fmu_export import base_units
from savgs_ident.export.gather import gather
from savgs_ident.export.linear_models import exact
from savgs_ident.export.public import EXPORTS
from savgs_ident.plants.base import Motion
from savgs_ident.plants.two_mass import closed_form
from savgs_ident.simulate.transient import solve_rates

from ..in_one_test import over
from .c_library import call

FREQUENCY = np.geomspace(0.3, 30.0, 25)
COUNT = 20


def _bare(plant: Any) -> si.PlantModel:
    return si.PlantModel(plant(), plant.parameters)


@dataclass(frozen=True)
class Written:
    """A model, and the folder with its files in all formats but FMI."""

    model: si.PlantModel
    folder: Path

    @property
    def exported(self) -> ExportedModel:
        """The model as exporters take it."""
        return ExportedModel(self.model)

    def instants(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """States and inputs of the size that the plant declares."""
        random, plant = np.random.default_rng(3), self.exported.plant
        sizes = [each.size for each in plant.coordinates] + [each.rate_size for each in plant.coordinates]
        sizes += [each.scale for each in plant.states]
        for _ in range(COUNT):
            u = np.array(resting_inputs(self.exported))
            yield random.standard_normal(len(sizes)) * sizes, u + 0.02 * random.standard_normal(u.size)

    def parameters(self) -> np.ndarray:
        """p."""
        return np.array(self.model.table.values_of(self.exported.equations.parameters))


MODELS = {
    "two_mass": _bare(si.TwoMass),
    "two_mass that rubs": (_bare(si.TwoMass) + "guide_coulomb").with_values(
        {"guide_coulomb_coefficient": 0.02}
    ),
    "axis": (_bare(si.Axis) + "guide_coulomb" + "screw_stiffness").with_values({"viscous_friction": 80.0}),
}


RUBS = "two_mass that rubs"
"""Its terms are those of the others, too, which are slow."""


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=() if name == RUBS else pytest.mark.slow) for name in MODELS],
)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Written:
    model, folder = MODELS[request.param], tmp_path_factory.mktemp("plant")
    done = si.export(model, [name for name in EXPORTS if name != "fmu"], folder)
    assert sorted(done.files) == sorted(folder.iterdir())
    assert done.trusted
    return Written(model, folder)


@eqx.filter_jit
def _truth(plant: si.AbstractPlant, p: Any, x: Array, u: Array) -> tuple[Array, Array, Array]:
    """dx/dt, the outputs and y by the solver of the simulator."""
    n, pack = len(plant.coordinates), plant.coordinate_type
    q, qd, s = pack(*x[:n]), pack(*x[n : 2 * n]), x[2 * n :]
    inputs = plant.drive(tuple(InputSignal(u[i], u[i + 1]) for i in range(0, u.shape[0], 2)))
    rates = solve_rates(plant, p, q, qd, s, inputs)
    shown = plant.read(p, Motion(q, qd, rates.qdd), s, rates.sd, inputs)
    y = jnp.concatenate([jnp.stack([*rates.qdd]), rates.sd])
    return jnp.concatenate([x[n : 2 * n], y]), jnp.stack([*shown]), y


def _true(written: Written, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    values = as_values(written.model.table.as_dict())
    rates, outputs, y = _truth(written.exported.plant, values, jnp.asarray(x), jnp.asarray(u))
    return np.asarray(rates), np.asarray(outputs), np.asarray(y)


def test_casadi_computes_what_the_model_computes(written: Written) -> None:
    rates, outputs, residual = (
        ca.Function.load(str(written.folder / f"{name}.casadi")) for name in ("rates", "outputs", "residual")
    )
    p = written.parameters()
    for x, u in written.instants():
        wanted, shown, y = _true(written, x, u)
        assert rates(x, u, p).full().ravel() == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        assert outputs(x, u, p).full().ravel() == pytest.approx(shown, rel=1e-9, abs=1e-12)
        # Forces of some 1e3 N balance to their rounding.
        assert np.max(np.abs(residual(x, y, u, p).full())) < 1e-7


def test_signals_are_those_that_the_plant_declares(written: Written) -> None:
    signals = json.loads((written.folder / "signals.json").read_text())
    plant = written.exported.plant
    coordinates = [(each.name, each.unit) for each in plant.coordinates]
    rates = [(f"{each.name}_dot", f"{each.unit}/s") for each in plant.coordinates]
    found = {name: [(each["name"], each["unit"]) for each in part] for name, part in signals.items()}
    assert found["x"][: 2 * len(coordinates)] == [*coordinates, *rates]
    assert len(found["x"]) == 2 * len(coordinates) + len(plant.states)
    assert found["outputs"] == [(each.name, each.unit) for each in plant.channels]
    assert found["u"] == [
        pair
        for each in plant.inputs
        for pair in ((each.name, each.unit), (f"{each.name}_rate", f"{each.unit}/s"))
    ]
    assert [each["value"] for each in signals["p"]] == [each.value for each in written.model.table.entries]
    # At rest nothing moves.
    wanted, _, _ = _true(
        written, *(np.array([each["at_rest"] for each in signals[name]]) for name in ("x", "u"))
    )
    assert wanted == pytest.approx(0.0, abs=1e-12)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_c_code_computes_what_the_model_computes(written: Written) -> None:
    shared = written.folder / "model.so"
    strict = ["-std=c99", "-Wall", "-Werror", "-Wno-unused", "-O1", "-fPIC", "-shared"]
    subprocess.run(["cc", *strict, str(written.folder / f"{STEM}.c"), "-o", str(shared), "-lm"], check=True)
    library, p = ctypes.CDLL(str(shared)), written.parameters()
    shared.unlink()
    for x, u in written.instants():
        wanted, shown, _ = _true(written, x, u)
        assert call(library, "rates", [x, u, p], wanted.size) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        assert call(library, "outputs", [x, u, p], shown.size) == pytest.approx(shown, rel=1e-9, abs=1e-12)


def test_python_control_has_the_nonlinear_plant(written: Written) -> None:
    path, bare = written.folder / "model-control.json", _bare(type(written.model.plant))
    system = si.load_python_control(path, bare)["nonlinear"]
    for x, u in written.instants():
        wanted, shown, _ = _true(written, x, u)
        assert system.dynamics(0.0, x, u) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        assert system.output(0.0, x, u) == pytest.approx(shown, rel=1e-9, abs=1e-12)
    x, u = si.resting_point(path, bare)
    assert x.tolist() == resting_state(written.exported)
    assert u.tolist() == resting_inputs(written.exported)


def test_a_document_comes_back_to_the_last_digit(written: Written) -> None:
    path = written.folder / "model.json"
    found = si.read_model_json(path, _bare(type(written.model.plant)))
    assert found.table == written.model.table
    assert found.effects == written.model.effects
    with pytest.raises(si.InputError, match=r"plant is '\w+'\. Remedy: give a model of \w+ to the call"):
        si.read_model_json(path)


def _validator() -> Draft202012Validator:
    schemas = [
        json.loads(files("savgs_ident.export").joinpath(name).read_text("utf-8"))
        for name in ("plant_model.schema.json", "model.schema.json")
    ]
    registry: Registry[Any] = Registry().with_resources(
        [(each["$id"], Resource.from_contents(each)) for each in schemas]
    )
    Draft202012Validator.check_schema(schemas[0])
    return Draft202012Validator(schemas[0], registry=registry)


def test_a_document_is_what_its_schema_describes(written: Written) -> None:
    document, validator = json.loads((written.folder / "model.json").read_text()), _validator()
    validator.validate(document)
    for name in document:
        assert not validator.is_valid({key: value for key, value in document.items() if key != name}), name


def test_matlab_has_the_parameters_and_the_linear_model(written: Written) -> None:
    found, linear = loadmat(written.folder / "model.mat", simplify_cells=True), exact(written.exported)
    assert found["name"] == written.model.plant_name
    assert "damper" not in found
    for entry in written.model.table.entries:
        assert found["parameters"][entry.name]["value"] == entry.value
    for name in "ABCD":
        wanted = getattr(linear.space, name)
        assert np.array_equal(np.reshape(found["state_spaces"]["exact"][name], wanted.shape), wanted)
    responses = found["frequency_responses"]
    assert set(responses) == {"frequency_hz", "exact"}
    wanted = linear.response(responses["frequency_hz"])
    assert np.array_equal(np.reshape(responses["exact"], wanted.shape), wanted)


@over("name", ["two_mass", "two_mass that rubs"])
def test_the_linear_model_of_the_two_masses_is_their_closed_form(name: str) -> None:
    """Dry friction is left out."""
    linear = exact(ExportedModel(MODELS[name]))
    assert linear.space.input_labels == ["road_height_rate"]
    per_height = linear.response(FREQUENCY)[:, 0] * (2j * np.pi * FREQUENCY)
    wanted = closed_form(MODELS[name].table.as_dict(), FREQUENCY).T
    assert per_height == pytest.approx(wanted, rel=1e-9)


def test_the_linear_model_of_the_axis_takes_the_force_itself() -> None:
    """M xdd = u - k x - F_v xd."""
    model = MODELS["axis"]
    linear, p = exact(ExportedModel(model)), model.table.as_dict()
    assert (linear.space.input_labels, linear.units["drive_force"]) == (["drive_force"], "N")
    iw = 2j * np.pi * FREQUENCY
    stiffness = p["holding"] + p["screw_stiffness_stiffness"]
    wanted = 1.0 / (p["mass"] * iw**2 + p["viscous_friction"] * iw + stiffness)
    assert linear.response(FREQUENCY)[0, 0] == pytest.approx(wanted, rel=1e-9)


def test_what_stands_anywhere_rests_at_the_origin() -> None:
    """A carriage without a position loop."""
    assert resting_state(ExportedModel(_bare(si.Axis) + "guide_coulomb")) == [0.0, 0.0, 0.0]


@pytest.mark.slow
def test_the_motion_of_python_control_is_the_free_vibration(tmp_path: Path) -> None:
    model = MODELS["two_mass"]
    (path,) = si.export(model, "python-control", tmp_path).files
    systems, times = si.load_python_control(path, _bare(si.TwoMass)), np.linspace(0.0, 0.5, 26)
    start = np.array([0.01, -0.004, 0.0, 0.1])
    moved = control.input_output_response(
        systems["nonlinear"],
        times,
        np.zeros((2, times.size)),
        start,
        solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-12},
    )
    a = systems["exact"].A[:4, :4]
    wanted = np.stack([expm(a * t) @ start for t in times], axis=1)
    assert np.max(np.abs(moved.states - wanted)) < 1e-7


@pytest.mark.skipif(find_spec("fmpy") is None or shutil.which("gcc") is None, reason="needs FMPy and gcc")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["two_mass", "axis"])
def test_the_fmu_is_valid_and_moves_as_the_plant(name: str, tmp_path: Path) -> None:
    import fmpy
    from fmpy.validation import validate_fmu

    model = MODELS[name]
    (file,) = si.export(model, "fmu", tmp_path).files
    assert validate_fmu(str(file)) == []
    equations = ExportedModel(model).equations
    by_name = {each.name: each for each in fmpy.read_model_description(str(file)).modelVariables}
    for signal in (*equations.states, *equations.inputs, *equations.outputs):
        assert by_name[signal.name].unit == signal.unit
        assert base_units(signal.unit)
    plant, start = ExportedModel(model).plant, np.array(resting_state(ExportedModel(model)))
    start[: len(plant.coordinates)] += [each.size for each in plant.coordinates]
    found = fmpy.simulate_fmu(
        str(file),
        stop_time=0.5,
        start_values=dict(zip((each.name for each in equations.states), start, strict=True)),
        output=[each.name for each in plant.coordinates],
        output_interval=0.01,
        relative_tolerance=1e-10,
    )
    (path,) = si.export(model, "python-control", tmp_path / "control").files
    system = si.load_python_control(path, _bare(type(model.plant)))["nonlinear"]
    moved = control.input_output_response(
        system, found["time"], np.zeros((2, found["time"].size)), start,
        solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-12, "method": "LSODA"},
    )  # fmt: skip
    for place, each in enumerate(plant.coordinates):
        assert np.max(np.abs(found[each.name] - moved.states[place])) < 1e-4 * each.size


def _diagnosed(kind: str, effects: list[str], **more: Any) -> dict[str, Any]:
    verdict = {"kind": kind, "effects": effects, "ports": ["guide"], "confusable_with": [], "sentence": ""}
    which = [{"effect": "guide_viscous", "effects": ["guide_viscous"],
              "parameters": {"guide_viscous_damping": {"value": 12.0, "unit": "N s/m"}}}]  # fmt: skip
    baseline = {"model": "TwoMass", "parameters": {}, "effects": []}
    return {"schema": 2, "baseline": baseline, "verdict": verdict, "where": {}, "which": which, "shrink": {},
            "next_test": []} | more  # fmt: skip


def test_what_a_diagnosis_names_joins_any_plant() -> None:
    found = gather(MODELS["two_mass"], _diagnosed("effect", ["guide_viscous"], identified={"k": 6.1e4}))
    assert found.model.effects == ("guide_viscous",)
    assert found.model.table["guide_viscous_damping"].value == 12.0
    assert found.model.table["k"].value == 6.1e4
    assert "all others are those of the model." in " ".join(found.said)


def test_effects_go_with_a_file_only(tmp_path: Path) -> None:
    with pytest.raises(si.InputError, match="effects go with a rig file only"):
        si.export(MODELS["two_mass"], "json", tmp_path, effects=("guide_viscous",))
    assert not list(tmp_path.iterdir())


def test_a_name_that_stands_for_two_things_is_refused_by_fmi(tmp_path: Path) -> None:
    twice = si.Parameter("z_s", 1.0, "m")
    table = si.ParameterTable((*si.TwoMass.parameters.entries, twice))
    with pytest.raises(si.InputError, match="two variables have the name 'z_s'"):
        si.export(si.PlantModel(si.TwoMass(), table), "fmu", tmp_path)


def test_a_unit_that_fmi_does_not_have_is_refused() -> None:
    with pytest.raises(si.InputError, match="the unit 'K/s' is not made of those of FMI"):
        base_units("K/s")
