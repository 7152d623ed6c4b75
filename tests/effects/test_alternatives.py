"""Several effects of which one acts: the model is that with this one alone, and one program serves them all."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.alternatives import shared_by
from savgs_ident.effects.base import InputSignal
from savgs_ident.effects.composition import sticking_contacts
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import LearnedForce, shared_force
from savgs_ident.effects.learned_functions import coefficients_at
from savgs_ident.plants.base import AbstractPlant, Motion
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, LEARNED, build_model
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.simulate.collocation import implicitness

from ..in_one_test import over

RIG = read_rig(default_rig_path())
FRICTIONAL = build_model(RIG, ("rail_coulomb", "tyre_friction"))
SHARED = shared_by(CATALOGUE.values())
WITH_STATES = [CATALOGUE[name] for name in SHARED]
VALUES = as_values(
    merge_parameters(
        RIG.parameters, *(ParameterTable(each.parameters) for each in CATALOGUE.values())
    ).as_dict()
)
FORCES = [each for each in LEARNED.values() if isinstance(each.law, LearnedForce)]


@eqx.filter_jit
def _balances(plant: AbstractPlant, seed: int, values: Values = VALUES) -> jax.Array:
    """What a plant leaves out of balance in a lively instant."""
    q, qd, qdd, states, rates, inputs = np.random.default_rng(seed).normal(size=(6, 8))
    size = len(plant.states)
    moved = Motion(
        *(plant.coordinate_type(*(share * each[:2])) for share, each in ((1e-2, q), (0.3, qd), (3.0, qdd)))
    )
    u = plant.drive(
        (InputSignal(5e-3 * inputs[0], 0.2 * inputs[1]), InputSignal(1.5 + 0.1 * inputs[2], jnp.zeros(())))
    )
    return plant.residual(values, moved, 1e-3 * states[:size], 1e-2 * rates[:size], u)


@over("effect", WITH_STATES)
def test_the_plant_with_one_of_several_is_the_plant_with_that_one(effect: Effect) -> None:
    alone = FRICTIONAL + effect
    shared = replace(FRICTIONAL, alternatives=(SHARED[effect.name],))
    others = [each for each in SHARED[effect.name].effects if each.name != effect.name]
    for other in others:
        instead = replace(FRICTIONAL, alternatives=(SHARED[other.name],))
        assert not np.allclose(_balances(instead, 3), _balances(alone, 3), rtol=1e-6)
    np.testing.assert_allclose(_balances(shared, 3), _balances(alone, 3), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose([float(each.scale) for each in shared.states], [s.scale for s in alone.states])
    np.testing.assert_array_equal(implicitness(shared), implicitness(alone))


def test_two_of_several_act_beside_each_other() -> None:
    one, other = CATALOGUE["mount_compliance"], CATALOGUE["body_oscillator"]
    alone = FRICTIONAL + one + other
    shared = replace(FRICTIONAL, alternatives=(SHARED[one.name], SHARED[other.name]))
    np.testing.assert_allclose(_balances(shared, 5), _balances(alone, 5), rtol=1e-12, atol=1e-12)


def test_one_program_serves_all_with_as_many_states() -> None:
    programs = {
        (len(each.states), jax.tree.structure(replace(FRICTIONAL, alternatives=(SHARED[each.name],))))
        for each in WITH_STATES
    }
    assert len(programs) == len({len(each.states) for each in WITH_STATES}) == 2


def _learned(effect: Effect) -> Values:
    """The rig's parameters and those of a learned force, all coefficients different."""
    seen = {"middle": 0.01, "stroke": 0.03, "speed": 0.4, "give": 1.3}
    numbers = {f"{effect.name}_{name}": value for name, value in seen.items()}
    numbers |= {name: 20.0 + place for place, name in enumerate(coefficients_at(effect.port))}
    table = merge_parameters(RIG.parameters, ParameterTable(effect.parameters))
    return as_values({**table.as_dict(), **numbers})


@over("effect", FORCES)
def test_a_learned_force_at_one_of_several_ports_is_that_at_its_port(effect: Effect) -> None:
    p = _learned(effect)
    shared = shared_force(effect, QuarterCar.ports)
    alone, plant = FRICTIONAL + effect, replace(FRICTIONAL, alternatives=(shared.law,))
    expected, found = _balances(alone, 3, p), _balances(plant, 3, shared.values(p))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    states = len(sticking_contacts(FRICTIONAL.effects))
    assert not np.allclose(expected[: 2 + states], _balances(FRICTIONAL, 3, p), rtol=1e-6)
    np.testing.assert_allclose([float(each.scale) for each in plant.states], [s.scale for s in alone.states])
    np.testing.assert_array_equal(implicitness(plant), implicitness(alone))


@pytest.mark.slow
@over("effect", FORCES)
def test_its_slopes_are_those_of_the_law_at_its_port(effect: Effect) -> None:
    p, shared = _learned(effect), shared_force(effect, QuarterCar.ports)
    alone, plant = FRICTIONAL + effect, replace(FRICTIONAL, alternatives=(shared.law,))
    names = [each.name for each in effect.parameters]

    def along(model: AbstractPlant, values: Values, moved: Sequence[str]) -> np.ndarray:
        slopes = jax.jacfwd(lambda some: _balances(model, 3, {**values, **some}))
        found = slopes({name: values[name] for name in moved})
        return np.array([found[name] for name in moved])

    expected, found = along(alone, p, names), along(plant, shared.values(p), shared.names(names))
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)
    assert np.count_nonzero(np.any(expected != 0.0, axis=1)) > 30


def test_one_program_serves_a_learned_force_at_all_ports() -> None:
    shared = [shared_force(each, QuarterCar.ports) for each in FORCES]
    plants = {jax.tree.structure(replace(FRICTIONAL, alternatives=(each.law,))) for each in shared}
    values = {
        tuple(sorted(each.values(_learned(effect)))) for each, effect in zip(shared, FORCES, strict=True)
    }
    assert len(FORCES) == 5
    assert len(plants) == len(values) == 1
