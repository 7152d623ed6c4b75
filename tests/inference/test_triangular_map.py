"""The triangular map: one to one, without change of volume, and it straightens a curved posterior."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from jaxtyping import Array

from savgs_ident.inference.near_mode import TriangularMap, identity_map, triangular_map_of

SIZE, ROWS = 4, 12


def _random_map(seed: int, size: float = 0.3) -> TriangularMap:
    random = np.random.default_rng(seed)
    slope, _ = np.linalg.qr(random.standard_normal((ROWS, SIZE)))
    return triangular_map_of(size * random.standard_normal((SIZE, SIZE, ROWS)), slope, np.ones(ROWS))


@given(t=arrays(float, (3, SIZE), elements=st.floats(-4.0, 4.0)), seed=st.integers(0, 50))
def test_the_inverse_undoes_the_map(t: np.ndarray, seed: int) -> None:
    triangular = _random_map(seed)
    there = np.asarray(_each(triangular, jnp.asarray(t)))
    assert np.abs(triangular.inverse(there) - t).max() < 1e-9 * (1.0 + np.abs(there).max())


@eqx.filter_jit
def _each(triangular: TriangularMap, ts: Array) -> Array:
    return jax.vmap(triangular)(ts)


@given(t=arrays(float, SIZE, elements=st.floats(-4.0, 4.0)), seed=st.integers(0, 50))
def test_it_keeps_volumes(t: np.ndarray, seed: int) -> None:
    jacobian = np.asarray(_jacobian(_random_map(seed), jnp.asarray(t)))
    assert abs(np.linalg.det(jacobian) - 1.0) < 1e-9


@eqx.filter_jit
def _jacobian(triangular: TriangularMap, t: Array) -> Array:
    return jax.jacfwd(triangular)(t)


def test_rows_with_second_derivatives_become_linear() -> None:
    """What bends the first row's direction along the last axis is made up for by the first coordinate."""
    random = np.random.default_rng(3)
    axes, _ = np.linalg.qr(random.standard_normal((ROWS, 3)))
    weight = np.exp(random.standard_normal(ROWS))
    # Weighted slopes are orthonormal together with the prior's share: the last axis is reported by that alone.
    slope = axes / weight[:, None]
    slope[:, 2] = 0.0
    second = np.zeros((3, 3, ROWS))
    second[2, 2] = 1.4 * slope[:, 0] - 0.6 * slope[:, 1]
    second[1, 2] = second[2, 1] = 0.5 * slope[:, 0]
    triangular = triangular_map_of(second, slope, weight)

    def rows(v: np.ndarray) -> np.ndarray:
        return np.asarray(slope @ v + 0.5 * np.einsum("i,j,ijm->m", v, v, second))

    def off(mapped: bool) -> float:
        worst = 0.0
        for t in random.uniform(-2.0, 2.0, (20, 3)):
            v = np.asarray(triangular(jnp.asarray(t))) if mapped else t
            worst = max(worst, float(np.abs(weight * (rows(v) - slope @ t)).max()))
        return worst

    # v_1 itself bends the first row's direction through v_1 v_2: of third order, left to the surrogate.
    third = 0.5 * 0.6 / 2.0 * 2.0**3 * np.abs(axes[:, 0]).max()
    assert off(mapped=True) <= third + 1e-9
    assert off(mapped=False) > 1.0


def test_a_pure_square_becomes_linear_exactly() -> None:
    random = np.random.default_rng(4)
    slope, _ = np.linalg.qr(random.standard_normal((ROWS, 2)))
    second = np.zeros((2, 2, ROWS))
    second[1, 1] = 2.0 * slope[:, 0]
    triangular = triangular_map_of(second, slope, np.ones(ROWS))
    for t in random.uniform(-3.0, 3.0, (20, 2)):
        v = np.asarray(triangular(jnp.asarray(t)))
        rows = slope @ v + 0.5 * np.einsum("i,j,ijm->m", v, v, second)
        np.testing.assert_allclose(rows, slope @ t, atol=1e-12)


def test_the_identity_moves_nothing() -> None:
    t = np.random.default_rng(0).standard_normal((5, SIZE))
    triangular = identity_map(SIZE)
    np.testing.assert_array_equal(triangular.inverse(t), t)
    np.testing.assert_array_equal(np.asarray(triangular(jnp.asarray(t[0]))), t[0])
