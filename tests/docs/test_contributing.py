"""The examples of CONTRIBUTING.md do what it says: each is a file, which is imported here as it stands there."""

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import as_values
from savgs_ident.effects import effect
from savgs_ident.effects.base import PortSignals
from savgs_ident.export import public
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.plants.at_rest import find_rest, nominal_inputs, standing
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.catalogue import build_model
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.plants.two_mass import TwoMass
from savgs_ident.recordings import read
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics

from ..relaxed import as_users_have_it

REPOSITORY = Path(__file__).resolve().parents[2]
EXAMPLES = dict(
    re.findall(r"^```python (\w+)\.py\n(.*?)^```$", (REPOSITORY / "CONTRIBUTING.md").read_text(), re.M | re.S)
)


@pytest.fixture(scope="module", autouse=True)
def _examples(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """All examples as files of one folder, beside those of the repository."""
    folder = tmp_path_factory.mktemp("contributing")
    for name, code in EXAMPLES.items():
        (folder / f"{name}.py").write_text(code)
    before, sys.path[:0] = list(sys.path), [str(folder), str(REPOSITORY / "examples")]
    with as_users_have_it():
        yield
    sys.path[:] = before
    for name in [*EXAMPLES, "pendulum"]:
        sys.modules.pop(name, None)


def _example(name: str) -> ModuleType:
    return importlib.import_module(name)


def test_there_is_an_example_of_each() -> None:
    assert set(EXAMPLES) == {"eddy_brake", "rail_eddy_brake", "shaken_pendulum", "npz", "table_export"}
    assert all(len(code.splitlines()) <= 40 for code in EXAMPLES.values())


def test_the_law_vanishes_at_its_null_brakes_and_is_found_at_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    law = _example("eddy_brake").EddyBrake()
    velocity = jnp.linspace(-1.0, 1.0, 41)

    def force(damping: Array) -> Array:
        zero = jnp.zeros_like(velocity)
        values = {"damping": damping, "velocity": jnp.asarray(0.3)}
        return law.force(values, PortSignals(zero, velocity, zero, zero), jnp.zeros(0))

    null, typical = jnp.asarray(0.0), jnp.asarray(100.0)
    assert not np.any(np.asarray(force(null)))
    assert np.all(np.isfinite(np.asarray(jax.jacfwd(force)(null))))
    assert np.all(np.asarray(force(typical) * velocity) <= 0.0)
    # The largest force is at the critical velocity.
    assert abs(float(velocity[int(jnp.argmin(force(typical)))]) - 0.3) < 1e-9

    monkeypatch.setattr(effect, "LAWS", (*effect.LAWS, law))
    found = effect.generic_effects(TwoMass.ports)
    assert {name for name in found if name.endswith("eddy_brake")} == {
        f"{port}_eddy_brake" for port in ("suspension", "guide", "tyre")
    }
    assert found["tyre_eddy_brake"].parameters[0].unit == "N s/m"


@pytest.mark.slow
def test_the_name_joins_the_quarter_car(rig: Rig) -> None:
    effect = _example("rail_eddy_brake").RAIL_EDDY_BRAKE
    bare = build_model(rig, ())
    model = bare + effect
    assert model.effects == (effect,)
    p = as_values({**rig.parameters.as_dict(), "rail_brake_damping": 80.0})
    u = nominal_inputs(model, p)
    at = standing(model, find_rest(bare, p, u).q)
    rising = at._replace(qd=at.qd._replace(z_s=jnp.asarray(0.2)))
    none = jnp.zeros(0)
    braked, free = (each.residual(p, rising, none, none, u) for each in (model, bare))
    np.testing.assert_allclose(abs(float((braked - free)[0])), 80.0 * 0.2 / 2.0, rtol=1e-6)


def test_the_pendulum_hangs_at_rest() -> None:
    plant = _example("pendulum").Pendulum()
    p = as_values(plant.parameters.as_dict())
    u = nominal_inputs(plant, p)
    rest = find_rest(plant, p, u)
    assert abs(float(rest.q.phi)) < 1e-12
    balance = plant.residual(p, standing(plant, rest.q), rest.s, rest.s, u)
    assert np.max(np.abs(np.asarray(balance))) < 1e-12


def test_the_pendulum_answers_as_its_closed_form_says_where_the_angle_is_small() -> None:
    plant = _example("pendulum").Pendulum()
    values = plant.parameters.as_dict()
    frequency = np.array([0.3, 0.6, 0.9, 2.0])
    shaken = jnp.asarray(np.tile([0.0, 1e-3 + 0j], (frequency.size, 1)))
    excitation = Excitation(jnp.asarray(frequency), {"pivot_accel": shaken})
    p = as_values(values)
    found = simulate_periodic(plant, p, excitation)
    assert all(status.ok for status in found.status())
    w = 2j * np.pi * frequency
    m, length, c, g = (values[name] for name in ("m", "L", "c", "g"))
    wanted = -m * length * 1e-3 / (m * length * (length * w**2 + g) + c * w)
    angle = np.asarray(harmonics(plant, p, found, 3))[:, 0]
    assert np.max(np.abs(angle[:, 1] - wanted) / np.abs(wanted)) < 1e-3
    assert np.max(np.abs(angle[:, 2:])) < 2e-4 * np.max(np.abs(wanted))


@pytest.mark.slow
def test_friction_at_the_pivot_shows_in_the_third_order_and_is_found_by_the_fit() -> None:
    shaken = _example("shaken_pendulum")
    angle = shaken.measured.harmonics[:, shaken.measured.channel("angle")]
    # 0.7 Hz is near the resonance; the pendulum is symmetric, so that there is no second order.
    assert abs(angle[2, 3]) > 20.0 * abs(angle[2, 2])
    fit = shaken.fit
    assert fit.trusted
    assert fit.free_names == ("c", "pivot_friction_force")
    for name, true in {"c": 0.03, "pivot_friction_force": 0.015}.items():
        assert abs(fit[name].value - true) < 3.0 * fit[name].stderr
        assert fit[name].stderr < 0.02 * true


@pytest.mark.slow
def test_its_posterior_holds_the_truth_and_its_friction_is_diagnosed() -> None:
    shaken = _example("shaken_pendulum")
    posterior, verdict = shaken.posterior, shaken.diagnosis.verdict
    assert posterior.trusted
    for name, true in {"c": 0.03, "pivot_friction_force": 0.015}.items():
        assert abs(posterior[name].median - true) < 3.0 * posterior[name].sd
        assert posterior[name].sd == pytest.approx(shaken.fit[name].stderr, rel=0.3)
    assert shaken.diagnosis.converged
    families = tuple(map(str, verdict.families))
    assert (verdict.kind, verdict.ports, families) == ("effect", ("pivot",), ("pivot/friction",))


def test_the_reader_reads_what_is_saved_and_refuses_what_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(read, "READERS", (*read.READERS, _example("npz").NPZ))
    time = np.arange(2000) / 200.0
    height = 0.01 * np.sin(2.0 * np.pi * time)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(time.size)
    path = tmp_path / "dwell_1.0Hz.npz"
    np.savez(path, time=time, road_height=height, susp_deflection_mm=1e3 * (0.5 * height + noise))
    (dwell,) = load_campaign(path).of_kind("dwell")
    assert dwell.frequency_hz == 1.0
    np.testing.assert_allclose(dwell.channels["road_height"].values, height)
    np.testing.assert_allclose(dwell.channels["susp_deflection"].values, 0.5 * height + noise, atol=1e-12)

    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(
        InputError, match=r"dwell_1.0Hz.npz: is no NumPy archive: .* Remedy: copy the file again"
    ):
        load_campaign(path)
    np.savez(path, road_height=height)
    with pytest.raises(InputError, match="has no array 'time'"):
        load_campaign(path)


def test_the_export_can_be_read_back(rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = _example("table_export").write_table
    table = public.Exporter("parameters as a table", write)
    monkeypatch.setattr(public, "EXPORTS", {**public.EXPORTS, "table": table})
    (path,) = public.EXPORTS["table"].write(ExportedModel(RigModel(rig, ("rail_coulomb",))), tmp_path)
    lines = path.read_text().splitlines()
    assert lines[0] == "name,value,unit"
    values = {name: float(value) for name, value, _ in (line.split(",") for line in lines[1:])}
    assert values["mu_r"] == 0.03
    assert values["k_t"] == rig.parameters["k_t"].value
