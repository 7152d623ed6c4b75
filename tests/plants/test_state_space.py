"""Plants written as systems of first order: the same motions as by their equations of motion, and as on paper."""

from pathlib import Path
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.plants.two_mass import GUIDE, MOUNT, PARAMETERS, SUSPENSION, TYRE
from savgs_ident.simulate.excitation import sine_excitation
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics

from ..relaxed import as_users_have_it

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> object:
    with as_users_have_it():
        yield


class FirstOrder(si.StateSpacePlant):
    """The linear quarter car as four states."""

    states_declared: ClassVar[Any] = (
        si.State("z_s", "m", 1e-2),
        si.State("v_s", "m/s", 1e-1, rate_of="z_s", rate=1.0),
        si.State("z_u", "m", 1e-2),
        si.State("v_u", "m/s", 1e-1, rate_of="z_u", rate=3.0),
    )
    inputs: ClassVar[Any] = (si.Input("road_height", "m", "road", moves=(1.0, 1.0)),)
    channels: ClassVar[Any] = (
        si.Channel("body_accel", "m/s^2", "sprung-mass acceleration"),
        si.Channel("susp_deflection", "m", "suspension deflection"),
    )
    ports: ClassVar[Any] = (SUSPENSION, GUIDE, TYRE, MOUNT)
    parameters: ClassVar[Any] = PARAMETERS

    def rhs(self, x: Any, u: Any, p: Any, f: Any) -> Any:
        """Accelerations of both masses."""
        way = f.deflection(MOUNT)
        push = p["k"] * (x.z_u - x.z_s - way.displacement) + p["c"] * (x.v_u - x.v_s - way.velocity)
        f.carry(MOUNT, push)
        push = push - f.force(SUSPENSION, x.z_u - x.z_s, x.v_u - x.v_s)
        guide = f.force(GUIDE, x.z_s, x.v_s, load=p["m_s"] * p["g"])
        height, speed = x.z_u - u.road_height, x.v_u - u.road_height_rate
        tyre = f.force(TYRE, height, speed) - p["k_t"] * height - p["c_t"] * speed
        return {"v_s": (push + guide) / p["m_s"], "v_u": (tyre - push) / p["m_u"]}

    def output(self, x: Any, dx: Any, u: Any, p: Any) -> Any:
        """What the sensors show."""
        return dx.v_s, x.z_u - x.z_s


@pytest.mark.parametrize(
    "effects",
    [
        pytest.param((), marks=pytest.mark.slow),
        pytest.param(("guide_coulomb",), marks=pytest.mark.slow),
        ("tyre_stiffening", "mount_compliance"),
    ],
)
def test_it_moves_as_the_same_plant_by_its_equations_of_motion(effects: tuple[str, ...]) -> None:
    hertz = np.array([1.3, 4.0])
    found = []
    for plant in (FirstOrder, si.TwoMass):
        model = si.load_plant(plant)
        for name in effects:
            model = model + name
        p = as_values(model.table.as_dict())
        excitation = sine_excitation(model.plant, model.table, hertz, {"road_height": 0.01})
        solution = simulate_periodic(model.plant, p, excitation)
        assert all(each.ok for each in solution.status())
        found.append(np.asarray(harmonics(model.plant, p, solution, 5)))
    size = np.max(np.abs(found[1]), axis=(0, 2), keepdims=True)
    # Both searches end within what the solver calls precise; their equations are scaled otherwise.
    assert np.max(np.abs(found[0] - found[1]) / size) < 1e-5


def test_a_state_that_is_no_ones_rate_is_one_of_the_plants_own() -> None:
    """The motor of the example against its transfer functions on paper."""
    model = si.load_plant(str(EXAMPLES / "servo/servo.py"))
    assert [each.name for each in model.plant.own_states] == ["i"]
    assert [each.name for each in model.plant.coordinates] == ["phi"]
    p, hertz = model.table.as_dict(), np.geomspace(0.5, 10.0, 6)
    excitation = sine_excitation(model.plant, model.table, hertz, {"voltage": 4.0})
    solution = simulate_periodic(model.plant, as_values(p), excitation)
    assert all(each.ok for each in solution.status())
    found = np.asarray(harmonics(model.plant, as_values(p), solution, 1))[:, :, 1]
    s = 2j * np.pi * hertz
    arm = p["J"] * s**2 + p["d"] * s + p["k"]
    current = 4.0 / (p["L"] * s + p["R"] + p["k_m"] ** 2 * s / arm)
    wanted = np.stack([p["k_m"] * current / arm, current], axis=1)
    # The error of the nodes.
    assert np.max(np.abs(found - wanted) / np.abs(wanted)) < 1e-3


def test_a_fault_of_an_input_reaches_the_right_hand_side() -> None:
    model = si.load_plant(str(EXAMPLES / "servo/servo.py")) + "supply_scale"
    scale = dict(model.plant.effects[0].numbers)
    name = next(str(each) for each in scale.values() if isinstance(each, str))
    hertz = np.array([1.0])
    excitation = sine_excitation(model.plant, model.table, hertz, {"voltage": 4.0})

    def first(value: float) -> Any:
        p = as_values({**model.table.as_dict(), name: value})
        return jnp.asarray(harmonics(model.plant, p, simulate_periodic(model.plant, p, excitation), 1))[
            0, :, 1
        ]

    np.testing.assert_allclose(first(0.1), 1.1 * first(0.0), rtol=1e-6)
