"""Recurrences that close after one period, against one dense solve of everything."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate import collocation
from savgs_ident.simulate.mesh import CHUNK, Layout
from savgs_ident.simulate.periodic import PeriodicSolution, node_steps

LAYOUTS = (
    Layout((CHUNK,)),
    Layout((2 * CHUNK, CHUNK)),
    Layout((CHUNK, 3 * CHUNK, 2 * CHUNK)),
    Layout((4 * CHUNK, CHUNK, CHUNK, 2 * CHUNK)),
    Layout((CHUNK, 3 * CHUNK, 2 * CHUNK), opened=(1,)),
    Layout((2 * CHUNK, CHUNK), opened=(0, 1)),
)
"""Dwells of unlike lengths, the longest first, last and in between, and windows that begin at rest."""


@partial(jax.jit, static_argnums=0)
def _solve(layout: Layout, steps: Array, right: Array) -> Array:
    return collocation.solve_recurrence(layout, collocation.factorise_recurrence(layout, steps), right)


@partial(jax.jit, static_argnums=0)
def _solve_many(layout: Layout, steps: Array, rights: Array) -> Array:
    factors = collocation.factorise_recurrence(layout, steps)
    return jax.lax.map(lambda right: collocation.solve_recurrence(layout, factors, right), rights)


_invert_nodes = jax.jit(collocation.invert_nodes)


def _dense(layout: Layout, steps: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """All x_n at once from x_{n+1} - M_n x_n = d_n, or x_0 = 0 from rest, the indices worked out here by hand."""
    (size, total), right = right.shape, right.copy()
    matrix = np.zeros((total, size, total, size))
    first = 0
    for number, count in enumerate(layout.counts):
        for place in range(count):
            here, after = first + place, first + (place + 1) % count
            matrix[here, :, after, :] += np.eye(size)
            if after < here and number in layout.opened:
                right[:, here] = 0.0
            else:
                matrix[here, :, here, :] -= steps[:, :, here]
        first += count
    flat = np.linalg.solve(matrix.reshape(total * size, -1), right.T.reshape(-1))
    return flat.reshape(total, size).T


def _draw(seed: int, layout: Layout, size: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Step matrices of spectral norm ``radius``, turning and shearing, and right sides of unlike sizes."""
    rng = np.random.default_rng(seed)
    drawn = rng.standard_normal((layout.total, size, size))
    steps = radius * drawn / np.linalg.norm(drawn, 2, axis=(1, 2), keepdims=True)
    right = rng.standard_normal((size, layout.total)) * 10.0 ** rng.uniform(-3.0, 3.0, (size, 1))
    return np.moveaxis(steps, 0, -1), right


@given(
    seed=st.integers(0, 2**32 - 1),
    layout=st.sampled_from(LAYOUTS),
    size=st.sampled_from((1, 5)),
    radius=st.floats(0.0, 0.995),
)
def test_it_solves_the_whole_cycle(seed: int, layout: Layout, size: int, radius: float) -> None:
    steps, right = _draw(seed, layout, size, radius)
    wanted = _dense(layout, steps, right)
    found = np.asarray(_solve(layout, steps, right))
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-10 * np.max(np.abs(wanted)))


def test_growing_directions_are_solved_too_if_the_period_closes() -> None:
    """A rotation slightly off a period neither grows nor decays; only I - product must be regular."""
    layout = Layout((CHUNK, 2 * CHUNK))
    angle = 0.31
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    steps = np.repeat(turn[:, :, None], layout.total, axis=2)
    right = np.random.default_rng(1).standard_normal((2, layout.total))
    found = np.asarray(_solve(layout, steps, right))
    assert found == pytest.approx(_dense(layout, steps, right), rel=1e-10, abs=1e-11)


def test_one_factorisation_serves_many_right_sides() -> None:
    layout = LAYOUTS[2]
    steps, first = _draw(3, layout, 5, 0.97)
    _, second = _draw(4, layout, 5, 0.97)
    rights = np.stack([first, second, 2.0 * first - 3.0 * second, np.zeros_like(first)])
    for right, found in zip(rights, np.asarray(_solve_many(layout, steps, rights)), strict=True):
        wanted = _dense(layout, steps, right)
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-10 * max(np.max(np.abs(wanted)), 1e-300))


@pytest.mark.slow
def test_dwells_do_not_see_each_other() -> None:
    layout = Layout((2 * CHUNK, CHUNK, 3 * CHUNK))
    steps, right = _draw(5, layout, 4, 0.99)
    whole = np.asarray(_solve(layout, steps, right))
    for dwell, count in enumerate(layout.counts):
        mine = layout.dwell == dwell
        alone = Layout((count,))
        single = np.asarray(_solve(alone, steps[..., mine], right[:, mine]))
        np.testing.assert_allclose(whole[:, mine], single, rtol=1e-13, atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from((1, 2, 3, 5, 7)))
def test_inverses_of_small_matrices_with_a_dominant_diagonal(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.uniform(-1.0, 1.0, (size, size, 40))
    matrix[np.arange(size), np.arange(size)] += 2.0 * size * rng.choice([-1.0, 1.0], (size, 40))
    found = np.asarray(_invert_nodes(matrix))
    wanted = np.linalg.inv(np.moveaxis(matrix, -1, 0))
    np.testing.assert_allclose(np.moveaxis(found, -1, 0), wanted, rtol=1e-11, atol=1e-12)


def test_products_are_taken_node_by_node() -> None:
    rng = np.random.default_rng(0)
    left, right, vector = (rng.standard_normal(shape) for shape in ((3, 4, 7), (4, 2, 7), (4, 7)))
    np.testing.assert_allclose(
        np.asarray(collocation.multiply_nodes(jnp.asarray(left), jnp.asarray(right))),
        np.einsum("ijp,jkp->ikp", left, right),
        rtol=1e-13,
        atol=1e-14,
    )
    np.testing.assert_allclose(
        np.asarray(collocation.apply_nodes(jnp.asarray(left), jnp.asarray(vector))),
        np.einsum("ijp,jp->ip", left, vector),
        rtol=1e-13,
        atol=1e-14,
    )


@pytest.mark.slow
def test_steps_of_a_sticking_motion_are_those_of_its_rates(
    friction: QuarterCar, programme: PeriodicSolution
) -> None:
    """A_n and B_n put together entry by entry, for states that slip and others, on nodes that are not even."""
    lin, layout = programme.linearised, programme.mesh.layout
    size, n = programme.trajectory.x.shape[0], len(friction.coordinates)
    flow = np.concatenate([np.zeros((n, size, layout.total)), np.asarray(lin.slope)])
    flow[np.arange(n), n + np.arange(n)] = 1.0
    weight = np.asarray(collocation.implicitness(friction))[:, None]
    assert {*weight.ravel()} == {0.5, 1.0}
    steps, eye = np.asarray(node_steps(programme.excitation, programme.mesh)), np.eye(size)[:, :, None]
    far = np.moveaxis(eye - steps[layout.preceding] * weight * flow, -1, 0)
    near = np.moveaxis(eye + steps * (1.0 - weight) * flow, -1, 0)
    inverse = np.moveaxis(np.asarray(lin.inverse), -1, 0)
    assert inverse @ far == pytest.approx(np.broadcast_to(np.eye(size), far.shape), abs=1e-8)
    products = np.moveaxis(np.asarray(lin.factors.steps), -1, 0)
    assert products @ far == pytest.approx(near, rel=1e-8, abs=1e-8 * np.max(np.abs(near)))
