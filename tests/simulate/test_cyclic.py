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

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate import collocation
from savgs_ident.simulate.collocation import Changes, Steps
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.mesh import CHUNK, Layout
from savgs_ident.simulate.periodic import PeriodicSolution, node_steps

from .drawn_steps import Drawn, draw

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
def _solve(layout: Layout, steps: Steps, weight: Array, right: Array) -> Changes:
    return collocation.solve_steps(layout, collocation.factorise_steps(layout, steps, weight), right)


@partial(jax.jit, static_argnums=0)
def _solve_many(layout: Layout, steps: Steps, weight: Array, rights: Array) -> Array:
    factors = collocation.factorise_steps(layout, steps, weight)
    return jax.lax.map(lambda right: collocation.solve_steps(layout, factors, right).x, rights)


_invert_nodes = jax.jit(collocation.invert_nodes)


def _dense(layout: Layout, drawn: Drawn) -> NDArray[np.float64]:
    """All dx_n at once from A_{n+1} dx_{n+1} - B_n dx_n = d_n, the indices worked out here by hand.

    What begins with a given state has A_0 dx_0 = 0.
    """
    (size, total), right = drawn.right.shape, drawn.right.copy()
    matrix = np.zeros((total, size, total, size))
    first = 0
    for number, count in enumerate(layout.counts):
        for place in range(count):
            here, after = first + place, first + (place + 1) % count
            matrix[here, :, after, :] += drawn.far[after]
            if after < here and number in layout.opened:
                right[:, here] = 0.0
            else:
                matrix[here, :, here, :] -= drawn.near[here]
        first += count
    flat = np.linalg.solve(matrix.reshape(total * size, -1), right.T.reshape(-1))
    return flat.reshape(total, size).T


@given(
    seed=st.integers(0, 2**32 - 1),
    layout=st.sampled_from(LAYOUTS),
    kind=st.sampled_from(((0, 1), (1, 0), (2, 1), (0, 4))),
    decay=st.floats(0.05, 1.0),
)
def test_it_solves_the_whole_cycle(seed: int, layout: Layout, kind: tuple[int, int], decay: float) -> None:
    drawn = draw(seed, layout, *kind, decay)
    wanted, places = _dense(layout, drawn), kind[0]
    found, rate = (np.asarray(each) for each in _solve(layout, *drawn.given))
    size = np.max(np.abs(wanted))
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-10 * size)
    assert rate == pytest.approx(np.einsum("pij,jp->ip", drawn.flow[:, places:], wanted), abs=1e-9 * size)


@pytest.mark.parametrize("kind", [(1, 0), (2, 1), (1, 2)])
def test_what_a_step_divides_by_is_undone(kind: tuple[int, int]) -> None:
    drawn = draw(7, LAYOUTS[2], *kind, 0.3)
    wanted = np.einsum("pij,jp->ip", drawn.far, drawn.right)
    found = np.asarray(collocation.undone(drawn.steps, drawn.weight, drawn.right))
    assert found == pytest.approx(wanted, rel=1e-10, abs=1e-11 * np.max(np.abs(wanted)))


def test_growing_directions_are_solved_too_if_the_period_closes() -> None:
    """A rotation slightly off a period neither grows nor decays; only I - product must be regular."""
    layout, angle = Layout((CHUNK, 2 * CHUNK)), 0.31
    # The trapezoidal rule turns an undamped oscillator by twice the arc tangent of half a step.
    flow = 2.0 * np.tan(angle / 2.0) * np.array([[0.0, -1.0], [1.0, 0.0]])
    far, near = np.eye(2) - 0.5 * flow, np.eye(2) + 0.5 * flow
    ones = np.ones(layout.total)
    steps = Steps(np.linalg.inv(far)[:, :, None] * ones, ones, ones)
    right = np.random.default_rng(1).standard_normal((2, layout.total))
    same = (layout.total, 1, 1)
    whole = (np.tile(each, same) for each in (far, near, flow))
    drawn = Drawn(steps, np.full((2, 1), 0.5), right, *whole)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    found = np.asarray(collocation.step_matrices(steps, drawn.weight))
    assert found == pytest.approx(turn[:, :, None] * ones, abs=1e-14)
    assert np.asarray(_solve(layout, *drawn.given).x) == pytest.approx(
        _dense(layout, drawn), rel=1e-10, abs=1e-11
    )


def test_one_factorisation_serves_many_right_sides() -> None:
    layout = LAYOUTS[2]
    drawn, other = (
        draw(3, layout, 2, 1, 0.1)._replace(right=draw(s, layout, 2, 1, 0.1).right) for s in (3, 4)
    )
    first, second = drawn.right, other.right
    rights = np.stack([first, second, 2.0 * first - 3.0 * second, np.zeros_like(first)])
    for right, found in zip(rights, np.asarray(_solve_many(layout, *drawn.given[:2], rights)), strict=True):
        wanted = _dense(layout, drawn._replace(right=right))
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-10 * max(np.max(np.abs(wanted)), 1e-300))


@pytest.mark.slow
def test_dwells_do_not_see_each_other() -> None:
    layout = Layout((2 * CHUNK, CHUNK, 3 * CHUNK))
    drawn = draw(5, layout, 1, 2, 0.05)
    whole = np.asarray(_solve(layout, *drawn.given).x)
    for dwell, count in enumerate(layout.counts):
        mine = layout.dwell == dwell
        steps = Steps(*(each[..., mine] for each in drawn.steps))
        single = np.asarray(_solve(Layout((count,)), steps, drawn.weight, drawn.right[:, mine]).x)
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
    friction: QuarterCar, numbers: Values, programme: PeriodicSolution
) -> None:
    """A_n and B_n put together entry by entry, for states that slip and others, on nodes that are not even."""
    lin, layout, at = programme.linearised, programme.mesh.layout, programme.trajectory
    size, n = at.x.shape[0], len(friction.coordinates)
    flow = np.concatenate([np.zeros((n, size, layout.total)), _slopes(friction, numbers, programme)])
    flow[np.arange(n), n + np.arange(n)] = 1.0
    weight = np.asarray(collocation.implicitness(friction))[:, None]
    assert {*weight.ravel()} == {0.5, 1.0}
    times, eye = np.asarray(node_steps(programme.excitation, programme.mesh)), np.eye(size)[:, :, None]
    far = np.moveaxis(eye - times[layout.preceding] * weight * flow, -1, 0)
    near = np.moveaxis(eye + times * (1.0 - weight) * flow, -1, 0)
    steps = collocation.steps_at(lin.factors, np.arange(layout.total))
    lower = np.moveaxis(np.asarray(steps.lower), -1, 0)
    assert lower @ far == pytest.approx(np.broadcast_to(np.eye(size)[n:], lower.shape), abs=1e-8)
    products = np.moveaxis(np.asarray(collocation.step_matrices(steps, lin.factors.weight)), -1, 0)
    assert products @ far == pytest.approx(near, rel=1e-8, abs=1e-8 * np.max(np.abs(near)))


def _slopes(friction: QuarterCar, numbers: Values, solved: PeriodicSolution) -> NDArray[np.float64]:
    """dy/dx at every node, (k, m, P), of the residual's own derivatives: nothing of the solver's."""
    excitation, at = solved.excitation, solved.trajectory
    u, prepared = inputs_at(friction, excitation, solved.mesh), friction.prepare(numbers)

    def residual(x: Array, y: Array) -> Array:
        return collocation.residual_at_nodes(friction, numbers, prepared, (*x, *y), u)

    def along(place: int, which: int) -> Array:
        still = [jnp.zeros_like(at.x), jnp.zeros_like(at.y)]
        still[which] = still[which].at[place].set(1.0)
        return jax.jvp(residual, (at.x, at.y), tuple(still))[1]

    by_x, by_y = (
        np.stack([np.asarray(along(place, which)) for place in range(each.shape[0])], axis=1)
        for which, each in enumerate((at.x, at.y))
    )
    found = -np.linalg.solve(np.moveaxis(by_y, -1, 0), np.moveaxis(by_x, -1, 0))
    return np.moveaxis(found, 0, -1)
