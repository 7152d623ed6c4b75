"""Motions near a known one: parts of a layout as systems of their own, and the motions that Newton's method finds."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate import collocation
from savgs_ident.simulate.collocation import Steps
from savgs_ident.simulate.mesh import CHUNK, Layout
from savgs_ident.simulate.nearby import solve_near, worst_dwells
from savgs_ident.simulate.periodic import PeriodicSolution, resolve

from .drawn_steps import draw
from .programme import altered

LAYOUTS = (
    Layout((2 * CHUNK, CHUNK, 3 * CHUNK, CHUNK)),
    Layout((CHUNK, 3 * CHUNK, 2 * CHUNK, CHUNK), opened=(1,)),
)

CHANGES = {"mu_r": 1.01, "mu_t": 0.97, "ydot_Hth": 1.02, "k_t": 1.01}
"""A standard error or two of a fit, and where friction sticks moves with them."""


@given(
    st.sampled_from(LAYOUTS), st.permutations(range(4)), st.integers(3, 7), st.sampled_from((0.0, 1.5, 3.5))
)
def test_a_part_holds_the_worst_dwells_whole(
    layout: Layout, order: list[int], room: int, enough: float
) -> None:
    left = np.empty(4)
    left[order] = [4.0, 3.0, 2.0, 1.0]
    part = worst_dwells(layout, jnp.asarray(left), enough, room)
    slots = min(4, room)
    fitting, free = [], room
    for dwell in order[:slots]:
        free -= layout.counts[dwell] // CHUNK
        if free < 0 or left[dwell] <= enough:
            break
        fitting.append(dwell)
    dwells = np.asarray(part.dwells)
    assert dwells[dwells < 4].tolist() == fitting
    kept, nodes, ahead = (np.asarray(each) for each in (part.write_to, part.nodes, part.following))
    needed = kept < layout.total
    assert kept[needed].tolist() == layout.nodes_of(fitting).tolist()
    np.testing.assert_array_equal(nodes[ahead[needed]], layout.following[nodes[needed]])
    np.testing.assert_array_equal(np.asarray(part.preceding)[ahead], np.arange(nodes.size))
    np.testing.assert_array_equal(dwells[np.asarray(part.dwell)[needed]], layout.dwell[kept[needed]])


@partial(jax.jit, static_argnums=0)
def _whole(layout: Layout, steps: Steps, weight: Array, right: Array) -> Array:
    return collocation.solve_steps(layout, collocation.factorise_steps(layout, steps, weight), right).x


@partial(jax.jit, static_argnums=0)
def _in_part(layout: Layout, left: Array, steps: Steps, weight: Array, right: Array) -> tuple[Array, Array]:
    part = worst_dwells(layout, left, 0.0, 4)
    some = Steps(*(each[..., part.nodes] for each in steps))
    factors = collocation.factorise_steps(part, some, weight)
    return part.write_to, collocation.solve_steps(part, factors, right[:, part.nodes]).x


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("worst", range(4))
def test_a_part_is_solved_like_the_whole(layout: Layout, worst: int) -> None:
    drawn = draw(worst, layout, 1, 2, 0.1)
    left = np.roll([4.0, 3.0, 2.0, 1.0], worst)
    kept, found = (np.asarray(each) for each in _in_part(layout, jnp.asarray(left), *drawn.given))
    needed = kept < layout.total
    assert needed.sum() >= CHUNK
    expected = np.asarray(_whole(layout, *drawn.given))[:, kept[needed]]
    np.testing.assert_allclose(found[:, needed], expected, rtol=1e-9, atol=1e-9)


@eqx.filter_jit
def _near(model: QuarterCar, p: Values, known: PeriodicSolution, limit: int, closely: float) -> tuple:
    return solve_near(model, p, known, known.trajectory, limit, 1e-5, closely)


@pytest.mark.parametrize(("closely", "off"), [(1e-6, 2e-4), (0.0, 1e-5)])
def test_the_motions_are_those_of_newtons_method(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution, closely: float, off: float
) -> None:
    """Where the known linearisation is used, a hundredth of how far they moved; and where it is not used at all."""
    p = altered(numbers, {name: factor * float(numbers[name]) for name, factor in CHANGES.items()})
    found, step = _near(friction, p, few, 60, closely)
    expected = resolve(friction, p, few)
    assert all(each.ok for each in expected.status())
    assert float(step) <= 1e-5
    size = np.abs(np.asarray(expected.trajectory.x)).max(axis=1, keepdims=True)
    moved = np.abs(np.asarray(few.trajectory.x - expected.trajectory.x)) / size
    missed = np.abs(np.asarray(found.x - expected.trajectory.x)) / size
    assert moved.max() > 1e-2
    assert missed.max() < off


def test_close_by_no_step_of_newtons_method_is_needed(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution
) -> None:
    p = altered(numbers, {name: (1.0 + 1e-6) * float(numbers[name]) for name in CHANGES})
    found, left = _near(friction, p, few, 0, 1e-6)
    expected = resolve(friction, p, few)
    assert float(left) <= 1e-6
    moved = np.abs(np.asarray(few.trajectory.x - expected.trajectory.x)).max(axis=1)
    missed = np.abs(np.asarray(found.x - expected.trajectory.x)).max(axis=1)
    assert np.all(moved > 0.0)
    assert np.all(missed < 0.05 * moved)


def test_at_the_known_parameters_nothing_moves(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution
) -> None:
    found, step = _near(friction, numbers, few, 60, 1e-6)
    assert float(step) <= 1e-9
    np.testing.assert_allclose(found.x, few.trajectory.x, atol=1e-9)


def test_too_few_iterations_are_told(friction: QuarterCar, numbers: Values, few: PeriodicSolution) -> None:
    p = altered(numbers, {"mu_r": 3.0 * float(numbers["mu_r"])})
    _, step = _near(friction, p, few, 1, 1e-6)
    assert not float(step) <= 1e-5
