"""The linearisation of any plant: against differences of its own rates, whatever its sizes are."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

import savgs_ident as si
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import InputSignal
from savgs_ident.plants.base import Motion
from savgs_ident.simulate.linearisation import (
    linearise_plant,
    nominal_rest,
    plant_signals,
    rest_or_origin,
)
from savgs_ident.simulate.transient import solve_rates

MODELS = {
    "two masses on a mount, rubbing": si.PlantModel(si.TwoMass(), si.TwoMass.parameters)
    + "guide_coulomb"
    + "mount_compliance",
    "axis": si.PlantModel(si.Axis(), si.Axis.parameters) + "guide_coulomb" + "screw_stiffness",
}


def _built(name: str) -> tuple[si.AbstractPlant, Values]:
    model = MODELS[name]
    effects = model.plant.effects
    null = {each: 0.5 * model.table[each].value for effect in effects for each in effect.null}
    return model.build(), as_values(model.table.as_dict() | null)


@eqx.filter_jit
def _rates_and_outputs(plant: si.AbstractPlant, p: Values, v: Array) -> Array:
    """What a simulation computes, along x and value and rate of each input."""
    n, s, pack = len(plant.coordinates), len(plant.states), plant.coordinate_type
    q, qd, states, u = pack(*v[:n]), pack(*v[n : 2 * n]), v[2 * n : 2 * n + s], v[2 * n + s :]
    inputs = plant.drive(tuple(InputSignal(u[i], u[i + 1]) for i in range(0, u.shape[0], 2)))
    rates = solve_rates(plant, p, q, qd, states, inputs)
    shown = plant.read(p, Motion(q, qd, rates.qdd), states, rates.sd, inputs)
    return jnp.stack([*qd, *rates.qdd, *rates.sd, *shown])


@pytest.mark.parametrize("name", MODELS)
def test_it_has_the_slopes_of_the_rates(name: str) -> None:
    plant, p = _built(name)
    at = nominal_rest(plant, p)
    space = linearise_plant(plant, p, at, plant_signals(plant)).space
    k, m = 2 * len(plant.coordinates) + len(plant.states), len(plant.inputs)
    centre = np.array([*at.q, *at.qd, *np.asarray(at.s), *(part for signal in at.signals for part in signal)])
    wanted = np.column_stack(
        [
            (_rates_and_outputs(plant, p, centre + step) - _rates_and_outputs(plant, p, centre - step)) / 2e-8
            for step in 1e-8 * np.eye(k + 2 * m)
        ]
    )
    held = space.nstates - k
    # Where the value of an input is a state, its column is in A and that of the rate in B.
    found = np.block([[space.A[:k], space.B[:k]], [space.C, space.D]])
    columns = np.r_[:k, k : k + 2 * m] if held else np.r_[:k, k : k + 2 * m : 2]
    assert np.max(np.abs(found - wanted[:, columns])) < 1e-5 * np.max(np.abs(wanted))
    assert np.all(wanted[:, np.setdiff1d(np.arange(k + 2 * m), columns)] == 0.0)


def test_a_rate_counts_whatever_its_factor_is() -> None:
    """The names of a linear model do not depend on its numbers: the tyre's damping may be zero."""
    model = MODELS["two masses on a mount, rubbing"].with_values({"c_t": 0.0})
    plant, p = model.build(), as_values(model.table.as_dict())
    found = linearise_plant(plant, p, nominal_rest(plant, p), plant_signals(plant))
    assert found.space.input_labels == ["road_height_rate"]
    assert found.space.state_labels[-1] == "road_height"
    assert found.units["road_height_rate"] == "m/s"


def test_units_are_those_that_the_plant_declares() -> None:
    plant, p = _built("axis")
    found = linearise_plant(plant, p, nominal_rest(plant, p), plant_signals(plant))
    names = (*found.space.state_labels, *found.space.input_labels, *found.space.output_labels)
    assert set(found.units) == set(names)
    assert (found.units["x_dot"], found.units["drive_force"], found.units["position"]) == ("m/s", "N", "m")


def test_what_falls_has_no_rest() -> None:
    """Only what is in balance stands wherever it is put."""
    plant, p = si.Axis(), as_values(si.Axis.parameters.as_dict())
    standing, pushed = (
        rest_or_origin(plant, p, plant.drive((InputSignal(jnp.asarray(force), jnp.zeros(())),)))
        for force in (0.0, 1.0)
    )
    assert float(standing.q.x) == 0.0
    assert np.isnan(float(pushed.q.x))


def test_a_plant_without_accelerations_is_refused() -> None:
    plant, p = _built("axis")
    weightless = {**p, "mass": jnp.zeros(())}
    with pytest.raises(si.InputError, match="the plant cannot be linearised there"):
        linearise_plant(plant, weightless, nominal_rest(plant, p), plant_signals(plant))
