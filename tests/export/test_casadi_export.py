"""Functions of CasADi on disk are the model, for any state, input and parameter."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.values import as_values
from savgs_ident.export.casadi_export import write_casadi
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.transient import solve_rates

pytestmark = pytest.mark.slow

COUNT = 60
EXAMPLE = Path(__file__).parents[2] / "examples" / "optimal_control.py"


@pytest.fixture(scope="module", params=["simqc", "simtr"])
def written(
    rig: Rig, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ExportedModel, Path]:
    """A model and the folder with its functions."""
    model = ExportedModel(RigModel(rig, MODELS[request.param]))
    folder = tmp_path_factory.mktemp(request.param)
    write_casadi(model, folder)
    return model, folder


def _instants(model: ExportedModel) -> list[tuple[np.ndarray, np.ndarray]]:
    """States and inputs on both sides of sticking, rolling and of lift-off."""
    random = np.random.default_rng(7)
    instants = []
    for _ in range(COUNT):
        z_s = 0.01 * random.standard_normal()
        moving = random.standard_normal(3) * [0.05, 0.2, 0.5]
        anchors = z_s + 1e-4 * random.standard_normal(len(model.equations.states) - 4)
        u = [0.02 * random.standard_normal(), 0.3 * random.standard_normal(), random.uniform(0.5, 2.6), 3.0]
        instants.append((np.array([z_s, *moving, *anchors]), np.array(u)))
    return instants


def test_rates_outputs_and_residual_are_those_of_the_model(written: tuple[ExportedModel, Path]) -> None:
    model, folder = written
    reported = {
        name: ca.Function.load(str(folder / f"{name}.casadi")) for name in ("rates", "outputs", "residual")
    }
    values = as_values(model.table.as_dict())
    p = np.array(model.table.values_of(model.equations.parameters))
    car = model.equations.model

    @eqx.filter_jit
    def true(x: Any, u: Any) -> tuple[Any, Any, Any]:
        q, qd = Coordinates(x[0], x[1]), Coordinates(x[2], x[3])
        inputs = Inputs(Road(u[0], u[1]), Link(u[2], u[3]))
        rates = solve_rates(car, values, q, qd, x[4:], inputs)
        loads = car.loads(values, Motion(q, qd, rates.qdd), x[4:], rates.sd, inputs)
        return jnp.stack([*rates.qdd]), rates.sd, jnp.stack([loads.vertical, loads.rail, loads.strut])

    for x, u in _instants(model):
        qdd, sd, loads = (np.asarray(part) for part in true(jnp.asarray(x), jnp.asarray(u)))
        rates = reported["rates"](x, u, p).full().ravel()
        expected = np.concatenate([x[2:4], qdd, sd])
        assert rates == pytest.approx(expected, rel=1e-7, abs=1e-7)
        outputs = reported["outputs"](x, u, p).full().ravel()
        assert outputs[0] == pytest.approx(qdd[0], rel=1e-7, abs=1e-7)
        assert outputs[2:5] == pytest.approx(loads, rel=1e-7, abs=1e-4)
        left = reported["residual"](x, np.concatenate([qdd, sd]), u, p).full().ravel()
        # Forces of up to 1e5 N balance to their rounding.
        assert np.max(np.abs(left)) < 1e-5


def test_the_names_say_what_stands_where(written: tuple[ExportedModel, Path]) -> None:
    model, folder = written
    signals = json.loads((folder / "signals.json").read_text())
    rates = ca.Function.load(str(folder / "rates.casadi"))
    assert [rates.size1_in(place) for place in range(3)] == [len(signals[name]) for name in ("x", "u", "p")]
    assert [entry["name"] for entry in signals["p"]] == list(model.equations.parameters)
    assert all(entry["unit"] for part in signals.values() for entry in part)
    # The rig begins at rest: nothing moves there.
    rest, still, p = (
        [e[key] for e in signals[n]] for n, key in (("x", "at_rest"), ("u", "at_rest"), ("p", "value"))
    )
    assert rates(rest, still, p).full().ravel() == pytest.approx(np.zeros(len(rest)), abs=1e-6)


def _example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("optimal_control", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("written", ["simqc"], indirect=True)
def test_an_optimal_link_rides_better_than_one_that_is_held(written: tuple[ExportedModel, Path]) -> None:
    example = _example()
    answer = example.main(written[1])
    rms = [float(np.sqrt(np.mean(each**2))) for each in (answer.passive, answer.active)]
    assert rms[1] < 0.7 * rms[0]
    low, high = example.ANGLES
    assert low - 1e-6 <= answer.link.min()
    assert answer.link.max() <= high + 1e-6
