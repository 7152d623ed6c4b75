"""What rows are along single axes beyond second order: exact where they were found, smooth between."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.inference.near_mode import PLACES, SHAPES, Curve, curve_of

AXES, ROWS = 3, 20


def weights() -> np.ndarray:
    return np.exp(np.random.default_rng(0).standard_normal(ROWS))


def along(axis: int, v: float) -> jax.Array:
    return jnp.zeros(AXES).at[axis].set(v)


def test_it_leads_through_what_was_found() -> None:
    left = np.random.default_rng(1).standard_normal((AXES, PLACES.size, ROWS))
    curve = curve_of(left, weights())
    assert curve.shape.shape[0] <= SHAPES
    for axis in range(AXES):
        for place, values in zip(PLACES, left[axis], strict=True):
            np.testing.assert_allclose(curve.at(along(axis, place)), values, atol=1e-10)
    np.testing.assert_array_equal(curve.at(jnp.zeros(AXES)), 0.0)


@pytest.fixture(scope="module")
def third_order() -> tuple[Curve, np.ndarray]:
    change = np.random.default_rng(2).standard_normal((AXES, ROWS))
    return curve_of(PLACES[:, None] ** 3 * change[:, None], weights()), change


@pytest.mark.parametrize("v", [-3.7, -1.1, 0.4, 2.9])
def test_a_change_of_third_order_is_exact(third_order: tuple[Curve, np.ndarray], v: float) -> None:
    curve, change = third_order
    for axis in range(AXES):
        np.testing.assert_allclose(curve.at(along(axis, v)), v**3 * change[axis], atol=1e-9)


def test_further_out_it_goes_on_as_at_the_last_place(third_order: tuple[Curve, np.ndarray]) -> None:
    curve, change = third_order
    np.testing.assert_allclose(curve.at(along(1, 9.0)), 81.0 * PLACES[-1] * change[1], atol=1e-8)


def test_it_is_smooth() -> None:
    curve = curve_of(np.random.default_rng(3).standard_normal((AXES, PLACES.size, ROWS)), weights())
    slopes = jax.jacfwd(lambda v: curve.at(along(0, v)))
    for place in (*PLACES[1:-1], 0.0):
        before, after = (np.asarray(slopes(jnp.asarray(place + off))) for off in (-1e-7, 1e-7))
        np.testing.assert_allclose(before, after, atol=1e-4)
