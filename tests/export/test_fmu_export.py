"""The FMU: valid after FMI 3.0, and the same motion in another simulator."""

import shutil
from pathlib import Path
from zipfile import ZipFile

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import as_values
from savgs_ident.export import fmu_export
from savgs_ident.export.exported_model import ExportedModel, resting_state
from savgs_ident.export.fmu_export import base_units, write_fmu
from savgs_ident.export.json_export import read_model_json
from savgs_ident.plants.parameter_toml import KNOWN_UNITS
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.inputs import RigSource, flat_road, held_link
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.transient import TransientSolution, simulate_transient, unpack_state

from ..in_one_test import over

fmpy = pytest.importorskip("fmpy", reason="needs FMPy")


if shutil.which("gcc") is None:
    pytest.skip("needs gcc", allow_module_level=True)


LIFT, DURATION = 0.02, 2.0
"""From how high the rig is let go [m], and for how long it is watched [s]."""


@pytest.fixture(scope="module")
def exported(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> tuple[ExportedModel, Path]:
    """A model and its FMU."""
    model = ExportedModel(RigModel(rig, MODELS["simtr"]))
    (file,) = write_fmu(model, tmp_path_factory.mktemp("simtr"))
    return model, file


def _let_go(model: ExportedModel) -> np.ndarray:
    x = np.array(resting_state(model))
    x[0] += LIFT
    x[4:] += LIFT
    return x


def _by_diffrax(model: ExportedModel, changes: dict[str, float]) -> TransientSolution:
    car, p = model.equations.model, as_values(model.table.as_dict() | changes)
    times = np.linspace(0.0, DURATION, round(1e3 * DURATION) + 1)
    start = unpack_state(car, jnp.asarray(_let_go(model)))
    return simulate_transient(
        car, p, RigSource(flat_road(), held_link(float(p["psi_nominal"]))), times, start, 1e-9
    )


def _by_fmpy(model: ExportedModel, file: Path, changes: dict[str, float]) -> np.ndarray:
    states = (signal.name for signal in model.equations.states)
    found: np.ndarray = fmpy.simulate_fmu(
        str(file),
        stop_time=DURATION,
        start_values=dict(zip(states, _let_go(model), strict=True)) | changes,
        output=["z_s", "sprung_accel", "tyre_load"],
        output_interval=1e-3,
        relative_tolerance=1e-9,
    )
    return found


@pytest.mark.slow
def test_it_is_valid(exported: tuple[ExportedModel, Path]) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(exported[1])) == []


@pytest.mark.slow
def test_every_variable_has_unit_and_description_and_all_digits(exported: tuple[ExportedModel, Path]) -> None:
    model, file = exported
    description = fmpy.read_model_description(str(file))
    assert description.fmiVersion == "3.0"
    assert description.modelExchange is not None
    by_name = {variable.name: variable for variable in description.modelVariables}
    for entry in model.table.entries:
        variable = by_name[entry.name]
        assert float(variable.start) == entry.value
        assert variable.causality == "parameter"
        assert variable.variability == "tunable"
        assert variable.unit == (None if entry.unit == "1" else entry.unit)
        assert variable.description == entry.about
    equations = model.equations
    for signal in (*equations.states, *equations.inputs, *equations.outputs):
        assert (by_name[signal.name].unit, by_name[signal.name].description) == (signal.unit, signal.about)


@pytest.mark.slow
def test_with_other_parameters_the_motion_is_that_of_diffrax(exported: tuple[ExportedModel, Path]) -> None:
    (model, file), changes = exported, {"m_s": 350.0, "c_sd": 4000.0}
    ours, theirs = _by_diffrax(model, changes), _by_fmpy(model, file, changes)
    assert ours.status().ok
    z_s = np.asarray(ours.motion.q.z_s)
    assert np.max(np.abs(theirs["z_s"] - z_s)) < 1e-4 * np.ptp(z_s)
    acceleration = np.asarray(ours.readings.sprung_accel)
    difference = theirs["sprung_accel"] - acceleration
    assert np.sqrt(np.mean(difference**2)) < 1e-4 * np.std(acceleration)


@pytest.mark.slow
def test_what_is_known_about_the_model_travels_inside(
    exported: tuple[ExportedModel, Path], tmp_path: Path
) -> None:
    model, file = exported
    with ZipFile(file) as archive:
        inside = Path(archive.extract(f"{fmu_export.EXTRA}/model.json", tmp_path))
    found = read_model_json(inside)
    assert found.model == model.model
    assert found.effects == model.effects


@pytest.mark.slow
def test_without_the_headers_of_fmi_it_says_what_to_install(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fmu_export, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"savgs-ident\[fmu\]"):
        write_fmu(ExportedModel(RigModel(rig, ())), tmp_path)


@over("unit", sorted(KNOWN_UNITS))
def test_every_unit_of_a_rig_file_has_base_units(unit: str) -> None:
    assert (base_units(unit) == {}) == (unit == "1")


@over(
    ("unit", "same"),
    [("N", "kg m/s^2"), ("J", "N m"), ("Pa", "N/m^2"), ("V", "W/A"), ("N m/A", "Wb"), ("V/(A s)", "ohm/s"),
     ("N m s/rad", "J s/rad"), ("m/(N s)", "s/kg"), ("Hz", "1/s"), ("H", "Wb/A")],
)  # fmt: skip
def test_equal_units_have_equal_base_units(unit: str, same: str) -> None:
    assert base_units(unit.replace("1/", "/")) == base_units(same.replace("1/", "/"))
