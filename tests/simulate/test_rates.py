"""Accelerations and rates of states at an instant, with everything in series that the catalogue has."""

from collections.abc import Callable

import jax
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import AbstractSeriesLaw
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.transient import Rates, solve_rates

from ..plants.quarter_car.instants import draw_instants, inputs_of, motion_of

pytestmark = pytest.mark.slow

COUNT = 30
SERIES = tuple(name for name, effect in CATALOGUE.items() if isinstance(effect.law, AbstractSeriesLaw))
NAMES = (*MODELS["simtr"], *SERIES)
WITH_VELOCITY = ("carcass_deflection", "frame_height")
NULL = {name: value for effect in SERIES for name, value in CATALOGUE[effect].null.items()}

Solve = Callable[[Values, NDArray[np.float64], NDArray[np.float64]], tuple[Rates, Array]]


@pytest.fixture(scope="module")
def yielding(rig: Rig) -> QuarterCar:
    """SimTR in which everything gives way."""
    return build_model(rig, NAMES)


@pytest.fixture(scope="module")
def values(rig: Rig) -> Values:
    """Its numbers, SI."""
    return as_values(model_parameters(rig, NAMES).as_dict())


@pytest.fixture(scope="module")
def solve(yielding: QuarterCar) -> Solve:
    """Rates at instants (COUNT, 10) with states (COUNT, s), and the residual that they leave."""

    @jax.jit
    def at(p: Values, instants: Array, s: Array) -> tuple[Rates, Array]:
        curves = yielding.prepare(p)

        def one(at: tuple[Array, Array]) -> tuple[Rates, Array]:
            motion, inputs = motion_of(at[0]), inputs_of(at[0])
            rates = solve_rates(yielding, p, motion.q, motion.qd, at[1], inputs, curves)
            found = Motion(motion.q, motion.qd, rates.qdd)
            return rates, yielding.residual(p, found, at[1], rates.sd, inputs, curves)

        return jax.lax.map(one, (instants, s))

    return at


def _states(model: QuarterCar, instants: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """The anchor about the sprung mass, what gives way within ``size`` of its scale."""
    rng = np.random.default_rng(8)
    scale = np.array([state.scale for state in model.states])
    s = size * scale * rng.standard_normal((COUNT, scale.size))
    s[:, 0] = instants[:, 0] + rng.uniform(-4e-5, 4e-5, COUNT)
    return s


def test_they_leave_no_residual(yielding: QuarterCar, values: Values, solve: Solve) -> None:
    instants = draw_instants(31, COUNT)
    rates, left = solve(values, instants, _states(yielding, instants, 0.1))
    assert np.isfinite(np.asarray(rates.sd)).all()
    assert np.max(np.abs(np.asarray(left)[:, :2])) < 1e-6
    assert np.max(np.abs(np.asarray(left)[:, 2:])) < 1e-9


def test_every_state_says_how_fast_it_moves(yielding: QuarterCar, values: Values, solve: Solve) -> None:
    instants = draw_instants(31, COUNT)
    rates, _ = solve(values, instants, _states(yielding, instants, 0.1))
    for place, state in enumerate(yielding.states):
        assert np.median(np.abs(np.asarray(rates.sd)[:, place])) > 1e-2 * state.scale, state.name


def test_without_compliance_the_rig_moves_as_if_nothing_gave_way(
    rig: Rig, yielding: QuarterCar, values: Values, solve: Solve
) -> None:
    """And what gives way stays where it is."""
    instants = draw_instants(31, COUNT)
    stiff = dict(values) | as_values(NULL)
    rates, _ = solve(stiff, instants, _states(yielding, instants, 0.0))
    simtr = build_model(rig, MODELS["simtr"])

    @jax.jit
    def bare(p: Values, instants: Array, anchor: Array) -> Rates:
        def one(at: tuple[Array, Array]) -> Rates:
            motion = motion_of(at[0])
            return solve_rates(simtr, p, motion.q, motion.qd, at[1], inputs_of(at[0]), simtr.prepare(p))

        return jax.lax.map(one, (instants, anchor))

    expected = bare(stiff, instants, _states(yielding, instants, 0.0)[:, :1])
    for found, wanted in zip(rates.qdd, expected.qdd, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.asarray(rates.sd)[:, 0], np.asarray(expected.sd)[:, 0], atol=1e-9)
    assert np.max(np.abs(np.asarray(rates.sd)[:, 1:])) < 1e-12


def test_their_slopes_are_those_of_differences(yielding: QuarterCar, values: Values, solve: Solve) -> None:
    """In all parameters of what gives way at once; instants at which a friction changes sides are left out."""
    instants = draw_instants(31, COUNT)
    s = _states(yielding, instants, 0.1)
    own = {parameter.name for effect in SERIES for parameter in CATALOGUE[effect].parameters}
    still = {name: np.zeros(()) for name in values}
    direction = still | {name: np.asarray(value) for name, value in values.items() if name in own}

    def moved(step: float) -> NDArray[np.float64]:
        p = {name: np.asarray(value) + step * direction[name] for name, value in values.items()}
        rates, _ = solve(p, instants, s)
        return np.column_stack([*rates.qdd, rates.sd])

    slope = jax.jvp(lambda p: solve(p, instants, s)[0], (dict(values),), (direction,))[1]
    found = np.column_stack([*slope.qdd, slope.sd])
    step = 1e-5
    near, far = moved(step) - moved(-step), moved(2.0 * step) - moved(-2.0 * step)
    expected = (8.0 * near - far) / (12.0 * step)
    size = np.max(np.abs(expected), axis=0)
    smooth = np.all(np.abs(far - 2.0 * near) / (4.0 * step) <= 1e-7 * size, axis=1)
    assert np.mean(smooth) > 0.9
    assert np.all(np.abs(found - expected)[smooth] <= 1e-7 * size)
    # What has a velocity among its states moves with it, whatever the parameters are.
    places = [2 + place for place, state in enumerate(yielding.states) if state.name in WITH_VELOCITY]
    assert np.flatnonzero(size == 0.0).tolist() == places
