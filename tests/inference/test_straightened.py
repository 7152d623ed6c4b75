"""Coordinates in which scalings are straight: logarithms near the centre, one to one everywhere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.inference.straightened import STRAIGHT, Straightened, straightened_about

TABLE = ParameterTable(
    (
        Parameter("stiffness", 157e3, "N/m", lower=1e3, upper=600e3),
        Parameter("damping", 5800.0, "N s/m", lower=0.0),
        Parameter("offset", 0.02, "m", lower=-1.0, upper=1.0),
        Parameter("mass", 320.0, "kg", tolerance=60.0, lower=0.0),
        Parameter("angle", 0.3, "rad", tolerance=0.1),
        Parameter("contact", 1e6, "N/m", source="typical"),
    )
)
"""One of every kind."""

FREE = FreeVector(TABLE, ("stiffness", "damping", "offset"), ("mass", "angle", "contact"))
STRAIGHT_ONES = np.array([True, True, False, True, False, False, False, False])


@pytest.fixture(scope="module", params=[0.0, 0.7])
def straightened(request: pytest.FixtureRequest) -> Straightened:
    return straightened_about(FREE, np.append(request.param * np.array([1, -1, 1, -1, 1, 1]), [0.2, 0.1]))


def values_at(straightened: Straightened, y: jax.Array) -> np.ndarray:
    found = FREE.to_constrained(straightened.points(y)[:-2])
    return np.array([float(found[name]) for name in FREE.names])


def test_near_the_centre_logarithms_are_straight(straightened: Straightened) -> None:
    rate, logged = np.asarray(straightened.rate), STRAIGHT_ONES[:-2]
    np.testing.assert_array_equal(rate > 0.0, STRAIGHT_ONES)
    at_centre = np.log(values_at(straightened, jnp.zeros(8))[logged])
    for share in (-0.6, 0.05, 0.5):
        y = np.where(STRAIGHT_ONES, share / np.where(STRAIGHT_ONES, rate, 1.0), 0.3)
        there = np.log(values_at(straightened, jnp.asarray(y))[logged])
        np.testing.assert_allclose(there - at_centre, share, atol=1e-9)


def test_points_and_coordinates_are_one_to_one(straightened: Straightened) -> None:
    for y in np.random.default_rng(0).standard_normal((20, 8)) * np.geomspace(0.1, 30.0, 20)[:, None]:
        point = straightened.points(jnp.asarray(y))
        assert np.all(np.isfinite(point))
        np.testing.assert_allclose(straightened.coordinates(point), y, rtol=1e-6, atol=1e-9)


def test_slopes_are_those_of_the_points(straightened: Straightened) -> None:
    np.testing.assert_allclose(straightened.slopes(jnp.zeros(8)), 1.0, atol=1e-12)
    for y in np.random.default_rng(1).standard_normal((10, 8)) * np.geomspace(0.1, 10.0, 10)[:, None]:
        exact = np.asarray(straightened.slopes(jnp.asarray(y)))
        step = 1e-6
        ahead, behind = (np.asarray(straightened.points(jnp.asarray(y + each))) for each in (step, -step))
        np.testing.assert_allclose(exact, (ahead - behind) / (2.0 * step), rtol=1e-5, atol=1e-7)


def test_near_a_bound_a_parameter_keeps_its_coordinate() -> None:
    table = ParameterTable((Parameter("stiffness", 157e3, "N/m", lower=1e3, upper=157e3 * STRAIGHT),))
    found = straightened_about(FreeVector(table, ("stiffness",)), np.array([0.1, 0.0, 0.0]))
    np.testing.assert_array_equal(found.rate, 0.0)


def test_a_value_stays_within_its_bounds(straightened: Straightened) -> None:
    for size in (-50.0, 50.0):
        values = values_at(straightened, jnp.full(8, size))
        for value, name in zip(values, FREE.names, strict=True):
            assert TABLE[name].lower <= value <= TABLE[name].upper
