"""model-control.json, loaded: the same linear systems, and the nonlinear one moves as the simulator says."""

import copy
import json
from pathlib import Path
from typing import Any

import control
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import as_values
from savgs_ident.export.exported_model import ExportedModel, resting_inputs, resting_state
from savgs_ident.export.linear_models import linear_models
from savgs_ident.export.python_control_export import load_python_control, resting_point, write_python_control
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.inputs import RigSource, cam_road, held_link
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.transient import simulate_transient

LIFT, FREQUENCY, DURATION = 0.0275, 2.35, 0.6
"""Of a cam that begins smoothly: [m], [Hz], [s]."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def path(model: ExportedModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the model with everything."""
    (written,) = write_python_control(model, tmp_path_factory.mktemp("control"))
    return written


@pytest.fixture(scope="module")
def systems(path: Path) -> dict[str, Any]:
    """What it holds."""
    return load_python_control(path)


def _instants(model: ExportedModel, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    random = np.random.default_rng(2)
    x, u = np.array(resting_state(model)), np.array(resting_inputs(model))
    return [
        (x + 1e-2 * random.standard_normal(x.size), u + 1e-2 * random.standard_normal(u.size))
        for _ in range(count)
    ]


def test_linear_systems_come_back_to_the_last_digit(systems: dict[str, Any], model: ExportedModel) -> None:
    w = 2.0 * np.pi * np.geomspace(0.5, 10.0, 20)
    for name, linear in linear_models(model).items():
        found = systems[name]
        assert isinstance(found, control.StateSpace)
        for matrix in "ABCD":
            assert np.array_equal(getattr(found, matrix), getattr(linear.space, matrix))
        assert found.state_labels == linear.space.state_labels
        assert found.input_labels == linear.space.input_labels
        assert found.output_labels == linear.space.output_labels
        assert np.array_equal(
            control.frequency_response(found, w).complex, control.frequency_response(linear.space, w).complex
        )


def test_the_nonlinear_right_side_is_the_equations(systems: dict[str, Any], model: ExportedModel) -> None:
    rig, equations = systems["nonlinear"], model.equations
    assert isinstance(rig, control.NonlinearIOSystem)
    assert rig.state_labels == [signal.name for signal in equations.states]
    assert rig.input_labels == [signal.name for signal in equations.inputs]
    assert rig.output_labels == [signal.name for signal in equations.outputs]
    p = jnp.asarray(model.table.values_of(equations.parameters))
    for x, u in _instants(model, 5):
        rates = np.asarray(equations.rates(jnp.asarray(x), jnp.asarray(u), p))
        assert rig.dynamics(0.0, x, u) == pytest.approx(rates, rel=1e-9, abs=1e-9)
        outputs = np.asarray(equations.read(jnp.asarray(x), jnp.asarray(u), p))
        assert rig.output(0.0, x, u) == pytest.approx(outputs, rel=1e-9, abs=1e-9)


def test_every_parameter_can_be_changed(systems: dict[str, Any], model: ExportedModel) -> None:
    rig, equations = systems["nonlinear"], model.equations
    changed = model.table.with_values({"k_t": 2e5, "mount_compliance": 3e-6})
    p = jnp.asarray(changed.values_of(equations.parameters))
    ((x, u),) = _instants(model, 1)
    found = rig.dynamics(0.0, x, u, params={"k_t": 2e5, "mount_compliance": 3e-6})
    wanted = np.asarray(equations.rates(jnp.asarray(x), jnp.asarray(u), p))
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    assert np.max(np.abs(found - rig.dynamics(0.0, x, u))) > 1e-2
    with pytest.raises(InputError, match="no parameter 'kt'"):
        rig.dynamics(0.0, x, u, params={"kt": 2e5})


def test_it_rests_where_it_says(systems: dict[str, Any], path: Path) -> None:
    x, u = resting_point(path)
    assert systems["nonlinear"].dynamics(0.0, x, u) == pytest.approx(np.zeros(x.size), abs=1e-6)


def test_it_moves_as_the_simulator_says(systems: dict[str, Any], model: ExportedModel, path: Path) -> None:
    """On a cam, with friction and the mount: python-control's integration against ours."""
    # Between these instants python-control takes the inputs as straight lines: of a cam, that is off by 3e-8 m.
    times = np.linspace(0.0, DURATION, round(DURATION / 2e-4) + 1)
    car, p = model.equations.model, as_values(model.table.as_dict())
    road, nominal = cam_road(LIFT, FREQUENCY, rise_time=0.2), float(p["psi_nominal"])
    ours = simulate_transient(car, p, RigSource(road, held_link(nominal)), times, tolerance=1e-9)
    assert ours.status().ok
    x, _ = resting_point(path)
    u = np.stack(
        [*(np.asarray(part) for part in ours.inputs.road), *(np.asarray(part) for part in ours.inputs.link)]
    )
    theirs = control.input_output_response(
        systems["nonlinear"],
        times,
        u,
        x,
        solve_ivp_method="RK45",
        solve_ivp_kwargs={"rtol": 1e-7, "atol": 1e-9},
    )
    z_s = np.asarray(ours.motion.q.z_s)
    assert np.ptp(z_s) > 0.01
    assert np.max(np.abs(theirs.states[0] - z_s)) < 1e-4 * np.ptp(z_s)
    acceleration = np.asarray(ours.readings.sprung_accel)
    difference = theirs.outputs[0] - acceleration
    assert np.sqrt(np.mean(difference**2)) < 1e-3 * np.std(acceleration)


def test_the_file_holds_no_code(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert set(json.loads(text)) == {"schema", "kind", "model", "state_spaces", "at_rest"}
    for word in ("import ", "lambda", "pickle", "__"):
        assert word not in text


def _fault(name: str, document: dict[str, Any]) -> dict[str, Any]:
    space = document["state_spaces"]["exact"]
    changes: dict[str, dict[str, Any]] = {
        "a model.json": document["model"],
        "another schema": document | {"schema": 3},
        "no model": {key: value for key, value in document.items() if key != "model"},
        "a model that is none": document | {"model": document["model"] | {"effects": ["magic"]}},
        "a space too few": document | {"state_spaces": {"exact": space}},
        "A that does not fit": document
        | {"state_spaces": document["state_spaces"] | {"exact": space | {"A": [[1.0]]}}},
        "a law that is another": document
        | {"state_spaces": document["state_spaces"] | {"exact": space | {"law": "x[k+1] = A x[k]"}}},
        "no signals": document
        | {"state_spaces": document["state_spaces"] | {"exact": space | {"states": {}, "A": [], "B": []}}},
    }
    return changes[name]


FAULTS = (
    "a model.json", "another schema", "no model", "a model that is none", "a space too few", "A that does not fit",
    "a law that is another", "no signals",
)  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_no_such_file_is_refused_with_file_and_remedy(fault: str, path: Path, tmp_path: Path) -> None:
    document = copy.deepcopy(json.loads(path.read_text(encoding="utf-8")))
    broken = tmp_path / "model-control.json"
    broken.write_text(json.dumps(_fault(fault, document)), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_python_control(broken)
    assert caught.value.source == str(broken)
    assert caught.value.remedy


def test_a_rest_that_does_not_fit_is_refused(path: Path, tmp_path: Path) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    document["at_rest"]["x"] = [0.0]
    broken = tmp_path / "model-control.json"
    broken.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match=r"at_rest\.x is .* not a matrix"):
        resting_point(broken)


def test_a_rig_without_friction_has_the_same_systems(rig: Rig, tmp_path: Path) -> None:
    (path,) = write_python_control(ExportedModel(RigModel(rig, MODELS["simqc"])), tmp_path)
    found = load_python_control(path)
    assert set(found) == {"equation_8", "exact", "nonlinear"}
    # Without friction, the exact linearisation is that of the nonlinear system, for which python-control has its own.
    x, u = resting_point(path)
    rough = control.linearize(found["nonlinear"], x, u, eps=1e-6)
    names = ("road_height", "link_angle")
    states = [found["exact"].state_labels.index(name) for name in names]
    inputs = [found["nonlinear"].input_labels.index(name) for name in names]
    assert rough.B[2:4, inputs] == pytest.approx(found["exact"].A[2:4, states], rel=1e-3, abs=1e-2)
    assert rough.A[2:4, :4] == pytest.approx(found["exact"].A[2:4, :4], rel=1e-3, abs=1e-2)
