"""Where a motion holds what slides: the same as Newton's method finds from anywhere, and in few steps."""

from collections.abc import Mapping
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import CREEP, DRAG_TIME, PortSignals
from savgs_ident.effects.learned import learned_effect, shared_force
from savgs_ident.effects.learned_functions import STRETCHES
from savgs_ident.inference.background.imposed import node_loads
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.two_mass import PARAMETERS, SUSPENSION, TwoMass
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.held_states import (
    ITERATIONS_OF_A_HOLD,
    resolve_with_states,
    with_held_states,
    with_states_of,
)
from savgs_ident.simulate.mesh import Layout, uniform_mesh
from savgs_ident.simulate.periodic import (
    PeriodicSolution,
    blank_solution,
    node_steps,
    resolve,
    simulate_periodic,
)

BARE, LAW = TwoMass(), learned_effect(SUSPENSION)
MODEL = BARE + LAW
P = as_values(PARAMETERS.as_dict())
AT_REST = as_values((PARAMETERS + ParameterTable(LAW.parameters)).as_dict())
LEARNED = as_values(
    {**AT_REST, "learned_suspension_give": 2.5, "learned_suspension_1": 5.0, "learned_suspension_2": 5.0}
)
"""With other widths of its springs, and a friction."""
WIDTHS = np.array(STRETCHES) * SUSPENSION.displacement
DWELLS = jnp.asarray([0.5, 0.9, 1.4, 2.35, 6.0])


@pytest.fixture(scope="module")
def known() -> PeriodicSolution:
    """Motions without the law, that turn round several times a period: some springs slide at some reversals alone."""
    heights = np.tile(0.006 * np.array([0.0, 1.0, 0.7j, 0.6], complex), (len(DWELLS), 1))
    found = simulate_periodic(BARE, P, Excitation(DWELLS, {"road_height": jnp.asarray(heights)}))
    assert all(status.ok for status in found.status())
    return found


def _signals_along(solution: PeriodicSolution) -> Mapping[str, PortSignals]:
    blank = blank_solution(BARE, solution.excitation, solution.mesh.layout)
    at = with_states_of(BARE, solution.trajectory)
    return node_loads(BARE, P, replace(blank, mesh=solution.mesh, trajectory=at))[0]


def test_a_law_that_does_nothing_yet_is_solved_in_the_few_steps_of_a_known_motion(
    known: PeriodicSolution,
) -> None:
    start = with_states_of(MODEL, known.trajectory)
    from_rest = resolve(MODEL, AT_REST, known, 300, start)
    found = resolve_with_states(MODEL, AT_REST, known, _signals_along)
    assert all(status.ok for each in (from_rest, found) for status in each.status())
    np.testing.assert_allclose(found.trajectory.x, from_rest.trajectory.x, atol=1e-9)
    assert int(found.iterations) < ITERATIONS_OF_A_HOLD < int(from_rest.iterations)


def test_anchors_are_held_where_newtons_method_finds_them(known: PeriodicSolution) -> None:
    at = replace(known, trajectory=with_states_of(MODEL, known.trajectory))
    held = with_held_states(MODEL, AT_REST, at, _signals_along(known))
    solved = resolve(MODEL, AT_REST, known, 300, held)
    anchors, truth = (np.asarray(each.x)[-len(WIDTHS) :] for each in (held, solved.trajectory))
    assert np.max(np.abs(anchors - truth)) < 0.02 * WIDTHS[0]
    assert np.ptp(truth[0]) > 10.0 * WIDTHS[0]
    # What is known to follow is not touched.
    again = with_held_states(MODEL, AT_REST, solved, _signals_along(solved))
    np.testing.assert_array_equal(again.x, solved.trajectory.x)


def test_other_widths_and_a_friction_lead_to_the_motion_that_is_found_from_rest(
    known: PeriodicSolution,
) -> None:
    null = resolve_with_states(MODEL, AT_REST, known, _signals_along)
    found = resolve_with_states(MODEL, LEARNED, null, _signals_along)
    from_rest = resolve(MODEL, LEARNED, known, 300, with_states_of(MODEL, known.trajectory))
    assert all(status.ok for each in (from_rest, found) for status in each.status())
    assert np.max(np.abs(np.asarray(found.trajectory.x - null.trajectory.x)[0])) > 1e-4
    np.testing.assert_allclose(found.trajectory.x, from_rest.trajectory.x, atol=1e-9)


def test_a_law_at_one_of_several_ports_is_solved_as_that_at_its_port(known: PeriodicSolution) -> None:
    shared = shared_force(LAW, TwoMass.ports)
    assert len(shared.law.ports) > 1
    plant = replace(BARE, alternatives=(shared.law,))
    alone = resolve_with_states(MODEL, LEARNED, known, _signals_along)
    found = resolve_with_states(plant, shared.values(LEARNED), known, _signals_along)
    assert all(status.ok for each in (alone, found) for status in each.status())
    np.testing.assert_allclose(found.trajectory.x, alone.trajectory.x, atol=1e-10)
    assert int(found.iterations) == int(alone.iterations)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
    st.floats(0.2, 3.0),
)
def test_springs_are_never_stretched_further_than_what_drags_them_and_anchors_move_where_they_are_alone(
    sines: list[float], cosines: list[float], size: float
) -> None:
    layout = Layout((48, 96))
    mesh = uniform_mesh(layout)
    phase, order = np.asarray(mesh.phase), np.arange(1, 4)[:, None]
    x = size * SUSPENSION.displacement * (sines @ np.sin(order * phase) + cosines @ np.cos(order * phase))
    excitation = Excitation(jnp.asarray([0.5, 2.0]), {"road_height": jnp.zeros((2, 2), complex)})
    blank = replace(blank_solution(MODEL, excitation, layout), mesh=mesh)
    unknown = Trajectory(jnp.full_like(blank.trajectory.x, np.nan), blank.trajectory.y)
    still = jnp.zeros_like(mesh.phase)
    seen = {"suspension": PortSignals(jnp.asarray(x), still, still, still)}
    held = with_held_states(MODEL, AT_REST, replace(blank, trajectory=unknown), seen)
    anchors, step = (
        np.asarray(held.x)[-len(WIDTHS) :],
        np.asarray(node_steps(excitation, mesh))[layout.preceding],
    )
    inner = np.setdiff1d(np.arange(layout.total), layout.starts)
    stretch, rate = (x - anchors)[:, inner], ((anchors - anchors[:, layout.preceding]) / step)[:, inner]
    over = np.abs(stretch) - WIDTHS[:, None]
    # What drags an anchor is the stretch beyond its width, over the time in which it follows.
    dragged = np.where(over > 0.0, np.sign(stretch) * over / DRAG_TIME, 0.0)
    np.testing.assert_allclose(rate, dragged + CREEP * stretch, atol=1e-9 / DRAG_TIME)
