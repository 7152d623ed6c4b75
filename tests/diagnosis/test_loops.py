"""The force that is drawn for a named effect is the force of the plant, its damper and its bristle included."""

from dataclasses import replace
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.values import Values, as_values
from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.effect_sensitivities import marched_effect
from savgs_ident.diagnosis.loops import effect_forces
from savgs_ident.diagnosis.problem import drawn_law, term_of
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned_functions import OF_A_CONTACT, coefficients_at, functions_at
from savgs_ident.inference.background.imposed import impose
from savgs_ident.inference.observations import Data
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, LEARNED
from savgs_ident.plants.quarter_car.ports import RAIL
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.sensitivity import loads_at_nodes

Case = tuple[DwellProblem, Data]


def force_of(model: AbstractPlant, p: Values, start: PeriodicSolution, effect: Effect) -> NDArray[np.float64]:
    found = effect_forces(model, [p], start, effect)
    assert found is not None
    return found[0]


@pytest.mark.slow
def test_the_force_of_a_mount_is_that_of_the_strut_with_its_nonlinear_damper(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, _ = plant_and_data
    p = plant.values({"mount_compliance": 2e-7, "mount_damping": 500.0})
    without, mounted = plant.complete(()), plant.complete(("mount_compliance",))
    deflection = marched_effect(without, [p], start, CATALOGUE["mount_compliance"])[0]
    x, y = start.trajectory
    state, rate = jnp.asarray(deflection.T)[:, None]
    moving = replace(start, trajectory=Trajectory(jnp.concatenate([x, state]), jnp.concatenate([y, rate])))
    expected = np.asarray(loads_at_nodes(mounted, p, moving).strut - loads_at_nodes(without, p, start).strut)
    force = force_of(without, p, start, CATALOGUE["mount_compliance"])
    np.testing.assert_allclose(force, expected, atol=1e-6 * np.abs(expected).max())
    linear = -(float(p["k_sd"]) * deflection[:, 0] + float(p["c_sd"]) * deflection[:, 1])
    assert np.abs(linear - expected).max() > 0.1 * np.abs(expected).max(), "the damper would pass for linear"


@pytest.mark.slow
def test_the_force_of_the_rails_friction_is_that_of_its_bristle(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, _ = plant_and_data
    model, p = plant.complete(()), plant.values({})
    loads = loads_at_nodes(model, p, start)
    expected = np.asarray(loads.rail)
    force = force_of(model, p, start, CATALOGUE["rail_coulomb"])
    size = np.sqrt(np.mean(expected**2))
    assert np.sqrt(np.mean((force - expected) ** 2)) < 0.02 * size
    sliding = loads.ports["rail"]
    tanh = -float(p["mu_r"]) * np.asarray(sliding.load * jnp.tanh(sliding.velocity / 1e-3))
    assert np.sqrt(np.mean((tanh - expected) ** 2)) > 0.1 * size, "a tanh would pass for the bristle"


@pytest.mark.slow
def test_what_a_contact_holds_by_a_learned_law_is_drawn_as_by_a_preload(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, _ = plant_and_data
    learned, preload = LEARNED["learned_rail"], CATALOGUE["rail_preload"]
    (held,) = (
        name
        for name, function in zip(coefficients_at(RAIL), functions_at(RAIL), strict=True)
        if function is OF_A_CONTACT
    )
    own = {each.name: each.value for each in learned.parameters} | dict(learned.null)
    p = plant.values(own | {held: 25.0, "rail_preload_force": 25.0})
    forces = []
    for effect, other in ((learned, preload), (preload, learned)):
        alone = as_values({name: float(value) for name, value in p.items()} | dict(other.null))
        forces.append(force_of(plant.complete(()), alone, start, effect))
    assert np.abs(forces[0]).max() > 20.0
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-6)


@pytest.mark.slow
def test_the_force_of_a_mount_does_to_the_response_what_the_mount_does(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, data = plant_and_data
    model, p = plant.complete(()), plant.values({"mount_compliance": 1e-9, "mount_damping": 500.0})
    deflection = marched_effect(model, [p], start, CATALOGUE["mount_compliance"])[0]
    force = force_of(model, p, start, CATALOGUE["mount_compliance"])
    signals = [("mount", deflection), ("strut", force)]
    given, same = impose(model, plant.likelihood, plant.orders, p, start, signals) / data.discrepancy_scale
    assert np.linalg.norm(same - given) < 0.01 * np.linalg.norm(given)


@pytest.mark.slow
def test_a_stiffer_tyre_pushes_in_proportion_to_its_compression(
    plant_and_data: Case, start: PeriodicSolution
) -> None:
    plant, _ = plant_and_data
    effect = CATALOGUE["tyre_stiffness"]
    (name,) = effect.null
    p = plant.values({name: effect.null[name] + 0.1})
    force = force_of(plant.complete(()), p, start, effect)
    ports = loads_at_nodes(plant.complete(()), p, start).ports
    compression = np.asarray(ports["tyre_radial"].displacement)
    stiffness = (force @ compression) / (compression @ compression)
    np.testing.assert_allclose(force, stiffness * compression, atol=1e-6 * np.abs(force).max())
    assert stiffness > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rail_preload", "tyre_stiffness", "mount_compliance", "damper_hysteresis"])
def test_forces_at_several_parameters_are_those_at_each_and_in_some_tests_those_in_all(
    plant_and_data: Case, start: PeriodicSolution, name: str
) -> None:
    plant, _ = plant_and_data
    effect, model = CATALOGUE[name], plant.complete(())
    (amplitude, *_), shapes = next(
        (term.amplitudes, term.tried[0]) for term in plant.candidates if term.name == name
    )
    first, other = (
        plant.values({**shapes, amplitude.name: amplitude.centre + share * amplitude.scale})
        for share in (0.1, 0.2)
    )
    both = effect_forces(model, [first, other], start, effect)
    assert both is not None
    assert np.abs(both[1] - both[0]).max() > 1e-3 * np.abs(both).max()
    for force, p in zip(both, (first, other), strict=True):
        np.testing.assert_allclose(force, force_of(model, p, start, effect), rtol=1e-9)
    (some,) = effect_forces(model, [first], start, effect, tests=(3,))  # type: ignore[misc]
    third = start.mesh.layout.nodes_of([3])
    np.testing.assert_allclose(some[third], both[0][third], rtol=1e-9)


@pytest.mark.parametrize(("rounding", "errors"), [(0.0, 1), (-1e-18, 1), (np.nan, 0)])
def test_a_law_is_drawn_whatever_the_covariance_of_its_numbers(rounding: float, errors: int) -> None:
    effect = CATALOGUE["rail_stribeck"]
    own = term_of(effect).coordinates[:1]
    fit = SimpleNamespace(coordinates=own, x=np.full(1, 0.5))
    search = SimpleNamespace(covariance=lambda _: np.full((1, 1), rounding))
    drawn = drawn_law(effect, {own[0].name: 1.0}, fit, search)  # type: ignore[arg-type]
    assert len(drawn.erring) == errors
    assert all(np.isfinite(each[own[0].name]) for each in drawn.erring)
