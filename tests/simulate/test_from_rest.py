"""Tests that begin at rest, of plants that do not forget: steps against an independent integration."""

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.effects.effect import generic_effects
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.from_file import load_plant
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.responses.harmonic_response import ComparedPart, HarmonicResponse
from savgs_ident.responses.windows import WHOLE_S, estimate_whole_tests
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.forgetting import forgetful_response
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from tests.simulate.linear_roads import INPUTS, RATE, READINGS, linear_readings, recording_of
from tests.simulate.slopes import assert_slopes_are_differences

RINGING = 40.0
"""Damping with which half of a motion of the body is left after six seconds [N s/m]."""

BENCH = Path(__file__).parents[2] / "examples" / "bench" / "bench.py"


def risen(time: NDArray[np.float64], at: float, height: float, lasting: float) -> NDArray[np.float64]:
    """A smooth step of some height [m] from ``at`` on [s]."""
    share = np.clip((time - at) / lasting, 0.0, 1.0)
    return height * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def ringing_step(name: str, seconds: float, height: float, begins: float = 0.6) -> Recording:
    """A plate that rises under two masses that ring, by the exponential of their state matrix."""
    time = np.arange(round(seconds * RATE)) / RATE
    plate = risen(time, begins, height, 0.1)
    readings = zip(READINGS, linear_readings(time, plate, c=RINGING, c_t=0.0), strict=True)
    return recording_of(name, "step", time, {"road_height": plate} | dict(readings))


def ringing() -> si.PlantModel:
    return si.PlantModel(TwoMass(), PARAMETERS.with_values({"c": RINGING, "c_t": 0.0}))


def steps(*tests: Recording) -> Campaign:
    return Campaign("made", tests, (), "")


@pytest.fixture(scope="module")
def two_steps() -> HarmonicResponse:
    made = steps(ringing_step("step_up", 8.0, 0.01), ringing_step("step_down", 5.0, -0.02))
    return forgetful_response(made, ringing(), 9)


def test_of_a_plant_that_rings_on_whole_tests_are_compared(two_steps: HarmonicResponse) -> None:
    assert two_steps.tests == ("step_up, 0.0 to 8.0 s", "step_down, 0.0 to 5.0 s")
    assert two_steps.part is not None
    assert two_steps.part.begins_at_rest.tolist() == [1.0, 1.0]


def test_the_motion_from_rest_is_that_of_the_state_matrix(two_steps: HarmonicResponse) -> None:
    model = ringing()
    plant, p = model.build(), as_values(model.table.as_dict())
    # What rings needs many nodes, or its frequency is off: the error falls with their square.
    finely = PeriodicSettings(window_rate=2160.0)
    solution = simulate_periodic(plant, p, measured_excitation(plant, two_steps, model.table), finely)
    assert all(status.ok for status in solution.status())
    places = [two_steps.channel(name) for name in READINGS]
    recorded, kept = two_steps.harmonics[:, places], two_steps.valid[:, places]
    found = np.asarray(harmonics(plant, p, solution, two_steps.orders))
    for test in range(2):
        for c in range(2):
            size, miss = recorded[test, c][kept[test, c]], (found - recorded)[test, c][kept[test, c]]
            assert np.sqrt(np.mean(np.abs(miss) ** 2)) < 2e-3 * np.sqrt(np.mean(np.abs(size) ** 2))


def test_slopes_from_rest_are_those_of_differences_where_friction_sticks(
    two_steps: HarmonicResponse,
) -> None:
    plant = TwoMass() + generic_effects(TwoMass.ports)["guide_preload"]
    table = ringing().table
    values = table.as_dict() | {"c": 400.0, "guide_preload_force": 20.0}
    solution = simulate_periodic(plant, as_values(values), measured_excitation(plant, two_steps, table))
    assert all(status.ok for status in solution.status())
    names = ("k", "guide_preload_force")
    assert_slopes_are_differences(plant, values, solution, names, orders=40, share=1e-6, tolerance=1e-6)


def test_before_the_road_moves_the_rig_rests_whatever_the_link_is_held_at(rig: Rig) -> None:
    names, seconds, count = MODELS["simtr"], 6.0, 1024
    model, p = build_model(rig, names), as_values(model_parameters(rig, names).as_dict())
    time = seconds * np.arange(count) / count
    bump = risen(time, 2.0, 0.01, 0.2) - risen(time, 4.0, 0.01, 0.5)
    orders = 2.0 / count * np.fft.rfft(bump)[:200]
    orders[0] = -orders[1:].sum().real
    part = ComparedPart(*(np.array([each]) for each in (2.0, 5.0, 1.0, 1.0, 0.0)))
    held = np.array([[float(p["psi_nominal"]) - 0.4]], np.complex128)
    driven = {"road_height": jnp.asarray(orders[None]), "link_angle": jnp.asarray(held)}
    excitation = Excitation(jnp.asarray([1.0 / seconds]), driven, part)
    solution = simulate_periodic(model, p, excitation)
    assert all(status.ok for status in solution.status())
    x, early = np.asarray(solution.trajectory.x), np.asarray(solution.mesh.phase) < 0.25 * 2.0 * np.pi
    moved = np.ptp(x[:2], axis=1)
    assert np.all(np.ptp(x[:2, early], axis=1) < 1e-3 * moved)
    assert abs(x[1, 0]) > 0.1 * moved[1]


def test_of_tests_that_do_not_begin_at_rest_the_beginning_is_to_be_estimated() -> None:
    moving = ringing_step("step_late", 6.0, 0.01, begins=0.0)
    found = forgetful_response(steps(ringing_step("step_up", 6.0, 0.01), moving), ringing(), 9)
    assert found.tests == ("step_up, 0.0 to 6.0 s", "step_late, 0.0 to 6.0 s")
    assert found.part is not None
    assert found.part.begins_at_rest.tolist() == [1.0, 0.0]
    assert found.part.begins_moving.tolist() == [0.0, 1.0]
    assert found.part.begin[0] > found.part.begin[1] == 0.0


def test_of_a_long_test_the_first_minute_is_compared_and_the_rest_is_said_to_be_left_out() -> None:
    made = estimate_whole_tests(steps(ringing_step("step_long", WHOLE_S + 20.0, 0.01)), INPUTS, READINGS)
    assert made.tests == (f"step_long, 0.0 to {WHOLE_S:.1f} s",)
    (warning,) = (each for each in made.warnings if each.test == "step_long")
    assert f"first {WHOLE_S:g} s only" in warning.what


TRUTH = {"m_s": 2.463, "m_u": 1.004, "k": 940.0, "c": 8.3, "k_t": 2440.0, "c_t": 5.6}
FRICTION, STUCK = 0.6, 6e3


def sticking_steps(seed: int) -> Campaign:
    """A quarter car for the bench whose guide sticks, as Dahl has it, on a plate that steps; by LSODA."""
    random, rate, p = np.random.default_rng(seed), 200.0, TRUTH
    noise = {"body": 5e-5, "wheel": 5e-5, "body_accel": 0.05}
    time = np.arange(0.0, 4.0, 1.0 / rate)

    def rates(t: float, x: NDArray[np.float64], plate: PchipInterpolator) -> list[float]:
        strut = p["k"] * (x[0] - x[2]) + p["c"] * (x[1] - x[3])
        tyre = p["k_t"] * (x[2] - plate(t)) + p["c_t"] * (x[3] - plate(t, 1))
        friction = STUCK * (x[1] - np.abs(x[1]) * x[4] / FRICTION)
        return [x[1], (-strut - x[4]) / p["m_s"], x[3], (strut - tyre) / p["m_u"], friction]

    def test(name: str, height: float) -> Recording:
        heights = risen(time, 0.5, height, 0.03)
        plate = PchipInterpolator(time, heights)
        found = solve_ivp(
            rates,
            (0.0, time[-1]),
            np.zeros(5),
            "LSODA",
            time,
            args=(plate,),
            rtol=1e-8,
            atol=1e-10,
            max_step=4e-3,
        )
        accel = np.array([rates(t, x, plate)[1] for t, x in zip(time, found.y.T, strict=True)])
        seen = {"body": found.y[0], "wheel": found.y[2], "body_accel": accel}
        values = {name: each + noise[name] * random.standard_normal(time.size) for name, each in seen.items()}
        return recorded(name, time, {"plate": heights} | values)

    still = {name: sd * random.standard_normal(time.size) for name, sd in noise.items()}
    standstill = replace(
        recorded("standstill", time, {"plate": np.zeros(time.size)} | still), kind="standstill"
    )
    return steps(standstill, *(test(f"step_{place}", 4e-3 * place) for place in (1, 2, 3)))


def recorded(name: str, time: NDArray[np.float64], values: dict[str, NDArray[np.float64]]) -> Recording:
    units = {"body_accel": "m/s^2"}
    channels = {each: RecordedChannel(each, units.get(each, "m"), time, x) for each, x in values.items()}
    return Recording(name, "step", None, channels)


@pytest.mark.slow
def test_steps_of_a_bench_that_sticks_identify_it() -> None:
    model = load_plant(f"{BENCH}:Bench")
    fit = si.fit(model + "guide_preload", sticking_steps(4))
    for name in ("k", "c"):
        found = fit[name]
        assert abs(found.value - TRUTH[name]) < 4.0 * found.stderr
        assert found.stderr < 0.15 * found.value
    # The law is another one: a spring that gives way at once, where Dahl's gives way little by little.
    assert fit["guide_preload_force"].value == pytest.approx(FRICTION, rel=0.1)
