"""The rig as a plant: slopes, columns of effects at their null, signals imposed at ports."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest

from savgs_ident.diagnosis import effect_sensitivities
from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.effect_sensitivities import marched_effect
from savgs_ident.effects.base import AbstractLaw
from savgs_ident.inference.background.imposed import impose, node_loads
from savgs_ident.inference.background.locations import free_signal
from savgs_ident.inference.background.port_functions import mesh_points
from savgs_ident.inference.observations import MULTIPLES, Data, Term
from savgs_ident.inference.prior import sheet_coordinate
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import PeriodicSolution

from .conftest import DWELLS
from .simple_laws import assert_a_law_of_one_function

Case = tuple[DwellProblem, Data]


def _term(plant: DwellProblem, name: str) -> Term:
    return next(term for term in plant.candidates if term.name == name)


def _relative(found: np.ndarray, expected: np.ndarray, data: Data) -> float:
    """Difference of two changes of the rows, in their own size, rows weighed by their reach."""
    weight = 1.0 / data.discrepancy_scale
    return float(np.linalg.norm((found - expected) * weight) / np.linalg.norm(expected * weight))


def test_candidates_are_what_the_baseline_lacks(plant_and_data: Case) -> None:
    plant, _ = plant_and_data
    assert {term.name for term in plant.candidates} == set(CATALOGUE) - {"rail_coulomb", "tyre_friction"}
    free = {"mu_r", "mu_t", "ydot_Hth", "c_sd"}
    names = {each.name for each in plant.nuisances}
    assert free < names
    assert {"m_s", "k_t", "accel_gain"} < names
    own = {each.name for term in plant.candidates for each in term.coordinates}
    assert not own & names


def test_what_the_papers_models_have_beyond_the_baseline_is_known_to_be_missing_together(
    plant_and_data: Case,
) -> None:
    plant, _ = plant_and_data
    both = ("rail_coulomb", "tyre_friction")
    assert plant.known == ()
    assert replace(plant, baseline=()).known == (both,)
    assert replace(plant, baseline=both[:1]).known == ()
    less = {name: effect for name, effect in CATALOGUE.items() if name != "rail_coulomb"}
    assert replace(plant, baseline=(), catalogue=less).known == ()


@pytest.mark.parametrize("baseline", [(), ("rail_coulomb",), ("rail_coulomb", "tyre_friction")])
def test_a_motion_of_the_smaller_model_is_one_of_the_complete_model(
    plant_and_data: Case, baseline: tuple[str, ...]
) -> None:
    """They have the same states, the rail's anchor among them."""
    plant = replace(plant_and_data[0], baseline=baseline)
    stateful = [name for name, effect in CATALOGUE.items() if effect.states]
    assert len(stateful) > 5
    for terms in ((), *((name,) for name in stateful), (stateful[0], "rail_preload"), tuple(stateful[:2])):
        complete = plant.complete(terms)
        acting = [each.effects[int(each.place)] for each in complete.alternatives]
        alone = replace(complete, alternatives=(), effects=(*complete.effects, *acting))
        assert plant.model(terms).states == alone.states
        sizes = [(float(each.scale), bool(each.slips)) for each in complete.states]
        assert sizes == [(each.scale, each.slips) for each in alone.states]


def test_what_the_sheet_knows_is_held_against_it_though_it_is_identified(
    plant_and_data: Case, rig: Rig
) -> None:
    known = {each.name: each for each in plant_and_data[0].nuisances}
    assert known["c_sd"] == sheet_coordinate(rig.parameters["c_sd"])
    centre, tolerance = rig.parameters["c_sd"].value, rig.parameters["c_sd"].tolerance
    assert float(known["c_sd"].value(1.0)) == pytest.approx(centre + tolerance)


@pytest.mark.slow
def test_what_was_rehearsed_is_what_scores_ask_for(
    plant_and_data: Case, start: PeriodicSolution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numbers of another type or shape, or of a law that was not rehearsed, would be compiled once more."""
    plant, _ = plant_and_data
    asked = list[tuple[object, ...]]()

    def march(law: AbstractLaw, *arguments: Any) -> Any:
        asked.append((type(law), *map(jax.typeof, jax.tree.leaves(arguments[:-1])), arguments[-1]))
        return marched(law, *arguments)

    marched = effect_sensitivities._march
    monkeypatch.setattr(effect_sensitivities, "_march", march)
    plant.rehearse()
    rehearsed, with_states = set(asked), [each for each in CATALOGUE.values() if each.states]
    asked.clear()
    plant.sensitivities((), {}, start, [_term(plant, each.name) for each in with_states])
    assert set(asked) == rehearsed
    assert len(rehearsed) == len({type(each.law) for each in with_states}) < len(with_states)


@pytest.mark.slow
def test_slopes_are_those_of_differences(plant_and_data: Case, start: PeriodicSolution) -> None:
    plant, data = plant_and_data
    steps = {"m_s": 0.05, "k_t": 50.0, "spring_rate_change": 1e-4, "accel_lag_time": 1e-5, "cam_cos_2": 1e-6}
    found = plant.predict((), {}, list(steps), start)
    assert found.solved
    for place, (name, step) in enumerate(steps.items()):
        centre = plant.table[name].value
        ahead, behind = (
            plant.predict((), {name: centre + sign * step}, [name], start).rows
            for sign in ((1.0, -1.0) if centre - step >= plant.table[name].lower else (1.0, 0.0))
        )
        width = step * (2.0 if centre - step >= plant.table[name].lower else 1.0)
        assert _relative(found.slopes[:, place], (ahead - behind) / width, data) < 0.02, name


@pytest.mark.slow
def test_the_column_of_a_mount_is_that_of_the_model_that_has_one(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, data = plant_and_data
    term = _term(plant, "mount_compliance")
    (columns,) = plant.sensitivities((), {}, start, [term])
    assert columns.shape == (len(MULTIPLES), data.measured.size, len(term.amplitudes))
    amplitude = term.amplitudes[0]
    small = 0.02 * amplitude.scale
    typical = {shape.name: shape.centre for shape in term.shapes}
    there = plant.predict((term.name,), typical | {amplitude.name: small}, [amplitude.name], start)
    none = plant.predict((term.name,), typical, [amplitude.name], start)
    assert there.solved
    expected = (there.rows - none.rows) / small
    assert _relative(columns[1][:, 0], expected, data) < 0.06


@pytest.mark.slow
def test_a_frame_that_is_marched_answers_its_load_as_an_oscillator_does(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, _ = plant_and_data
    numbers = {"frame_mobility": 1e-3, "frame_frequency": 9.0, "frame_damping_ratio": 0.1}
    p = plant.values(numbers)
    model, nodes = plant.complete(()), mesh_points(start)
    marched = marched_effect(model, [p], start, CATALOGUE["frame_mode"])[0][:, 0]
    load = np.asarray(node_loads(model, p, start)[1]["frame"].beyond_rest)
    own, grid = 2.0 * np.pi * 9.0, 2.0 * np.pi * np.arange(1024) / 1024
    for test in range(len(DWELLS)):
        rows = nodes.dwell == test
        spectrum = np.fft.rfft(np.interp(grid, nodes.phase[rows], load[rows], period=2.0 * np.pi))
        omega = nodes.omega[rows][0] * np.arange(spectrum.size)
        answer = np.fft.irfft(1e-3 * spectrum / (own**2 - omega**2 + 0.2j * own * omega), 1024)
        expected = np.interp(nodes.phase[rows], grid, answer, period=2.0 * np.pi)
        miss = marched[rows] - expected
        assert np.sqrt(np.mean(miss**2)) < 0.05 * np.sqrt(np.mean(expected**2))


@pytest.mark.slow
def test_a_force_that_is_imposed_acts_like_the_effect_that_makes_it(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, data = plant_and_data
    p = plant.values({})
    ports, _ = node_loads(plant.complete(()), p, start)
    wave = -np.asarray(ports["rail"].velocity)
    imposed = impose(plant.complete(()), plant.likelihood, plant.orders, p, start, [("rail", wave)])[0]
    (columns,) = plant.sensitivities((), {}, start, [_term(plant, "rail_viscous")])
    assert _relative(imposed, columns[0][:, 0], data) < 1e-6


@pytest.mark.slow
def test_every_port_is_a_place_and_explains_what_acts_there(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, data = plant_and_data
    places = {each.name: each for each in plant.locations((), {}, start)}
    assert set(places) == {
        "rail", "strut", "suspension", "tyre_radial", "tyre_lateral", "link", "road", "frame", "inertia",
        "sensor.sprung_accel", "sensor.susp_deflection",
    }  # fmt: skip
    weight = 1.0 / data.discrepancy_scale
    for effect, port in (
        ("rail_viscous", "rail"),
        ("bushing_stiffness", "suspension"),
        ("accel_gain", "sensor.sprung_accel"),
    ):
        (columns,) = plant.sensitivities((), {}, start, [_term(plant, effect)])
        change = columns[0][:, 0] * weight

        def left(name: str, change: np.ndarray = change) -> float:
            law = np.concatenate([each.columns for each in places[name].laws], axis=1) * weight[:, None]
            law = law[:, np.linalg.norm(law, axis=0) > 0.0]
            law = law / np.linalg.norm(law, axis=0)
            fitted, *_ = np.linalg.lstsq(law, change, rcond=1e-10)
            return float(np.linalg.norm(change - law @ fitted) / np.linalg.norm(change))

        assert left(port) < 0.01, effect
        elsewhere = "sensor.susp_deflection" if port != "sensor.susp_deflection" else "rail"
        assert left(elsewhere) > 0.5, effect


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "port"),
    [
        ("cam_scale", "road"),
        ("rail_viscous", "rail"),
        ("bushing_stiffness", "suspension"),
        ("deflection_delay", "sensor.susp_deflection"),
    ],
)
def test_what_is_simple_has_a_law_of_one_function_at_its_port(
    plant_and_data: Case, start: PeriodicSolution, effect: str, port: str
) -> None:
    """The fast tests have the same on the plant of two masses."""
    plant, data = plant_and_data
    assert_a_law_of_one_function(plant, data, {}, start, effect, port)


def test_a_free_signal_is_the_sum_of_its_harmonics(start: PeriodicSolution) -> None:
    nodes = mesh_points(start)
    coefficients = np.zeros(18)
    coefficients[2], coefficients[5] = 3.0, -2.0
    phase = nodes.phase[:50]
    np.testing.assert_allclose(
        free_signal(coefficients, phase), 3.0 * np.cos(2 * phase) - 2.0 * np.sin(3 * phase), atol=1e-12
    )


@pytest.mark.slow
def test_corrected_rows_are_those_of_many_nodes(plant_and_data: Case, start: PeriodicSolution) -> None:
    """A frame's resonance is where a coarse rule puts it wrong."""
    plant, data = plant_and_data
    values = {"frame_mobility": 1e-3, "frame_frequency": 12.0, "frame_damping_ratio": 0.05}
    terms = ("frame_mode",)
    coarse = plant.predict(
        terms, values, ["m_s"], plant.refined(terms, values, _near(plant, terms, values, start))
    )
    better = plant.corrected(terms, values, coarse.warm_start).predict(
        terms, values, ["m_s"], coarse.warm_start
    )
    fine = replace(plant, settings=replace(plant.settings, nodes=1024))
    truth = fine.predict(terms, values, ["m_s"], _near(fine, terms, values, fine.start({})))
    truth = fine.predict(terms, values, ["m_s"], fine.refined(terms, values, truth.warm_start))
    assert coarse.solved
    assert better.solved
    assert truth.solved
    weight = 1.0 / data.discrepancy_scale
    before, after = (np.linalg.norm((each.rows - truth.rows) * weight) for each in (coarse, better))
    assert after < 0.3 * before
    # Under other terms nothing is corrected.
    np.testing.assert_array_equal(
        plant.predict((), {}, ["m_s"], start).rows,
        plant.corrected(terms, values, coarse.warm_start).predict((), {}, ["m_s"], start).rows,
    )


def _near(
    plant: DwellProblem, terms: tuple[str, ...], values: dict[str, float], start: PeriodicSolution
) -> PeriodicSolution:
    return plant.predict(terms, values, ["m_s"], start).warm_start


@pytest.mark.parametrize("orders", [3, 9])
def test_a_free_signal_has_as_many_orders_as_it_has_coefficients(orders: int) -> None:
    phase = np.linspace(0.0, 2.0 * np.pi, 50)
    coefficients = np.zeros(2 * orders)
    coefficients[-2:] = 2.0, -1.0
    expected = 2.0 * np.cos(orders * phase) - np.sin(orders * phase)
    assert np.allclose(free_signal(coefficients, phase), expected)
