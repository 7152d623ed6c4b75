"""The Radau rule over a period: its order, and what it keeps."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from savgs_ident.fit.collocation.transcription import A, C, Points, radau_points, step_rule
from savgs_ident.simulate.mesh import Layout, Mesh, uniform_mesh


def _uneven(layout: Layout) -> Mesh:
    """Nodes that are dense in one half of the period."""
    even = uniform_mesh(layout)
    phase = np.asarray(even.phase) + 0.5 * np.sin(np.asarray(even.phase))
    gap = np.mod(phase[layout.following] - phase, 2.0 * np.pi)
    return Mesh(layout, phase, gap, gap / (2.0 * np.pi))


def _rule(points: Points) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Columns of one state and its rate at each point."""
    total = points.mesh.layout.total
    return np.arange(total)[:, None], total + np.arange(total)[:, None]


def test_its_coefficients_integrate_what_two_points_can() -> None:
    """a c^k = c^(k+1) / (k+1) for k = 0, 1, and the last point, where the step ends, also for k = 2."""
    assert A.sum(axis=1) == pytest.approx(C)
    found = A @ C
    assert found == pytest.approx(C**2 / 2.0)
    assert A[1] @ C**2 == pytest.approx(1.0 / 3.0)


def test_points_stand_in_pairs_and_each_step_begins_where_the_one_before_ends() -> None:
    layout = Layout((32, 16))
    points = radau_points(_uneven(layout))
    phase = np.asarray(points.mesh.phase)
    assert points.step.size == points.before.size == 24
    for dwell, first in ((0, 0), (1, 16)):
        mine = phase[layout.dwell == dwell]
        assert np.all(np.diff(mine) > 0.0)
        assert mine[-1] == pytest.approx(2.0 * np.pi)
        steps = points.step[first : first + mine.size // 2]
        assert steps.sum() == pytest.approx(2.0 * np.pi)
        assert mine[1::2] == pytest.approx(np.cumsum(steps))
        assert points.before[first] == layout.starts[dwell] + mine.size - 1
    assert points.before[1:16].tolist() == list(range(1, 31, 2))


@pytest.mark.parametrize("counts", [(16,), (32, 48)])
def test_it_vanishes_on_states_and_rates_that_keep_it(counts: tuple[int, ...]) -> None:
    layout = Layout(counts)
    points = radau_points(_uneven(layout))
    states, rates = _rule(points)
    rate = np.random.default_rng(2).standard_normal(layout.total)
    state = np.zeros(layout.total)
    for dwell, start in enumerate(layout.starts):
        here, value = 0.0, slice(start, start + counts[dwell])
        for step in range(counts[dwell] // 2):
            pair = start + 2 * step + np.arange(2)
            state[pair] = here + points.step[start // 2 + step] * (A @ rate[pair])
            here = state[pair[1]]
        assert np.isfinite(state[value]).all()
    rule = step_rule(points, points.step, states, rates)
    left = rule @ np.concatenate([state, rate])
    # The first step of a dwell begins where its last one ends: one period's gain is missed there.
    missed = np.zeros(layout.total)
    for start, count in zip(layout.starts, counts, strict=True):
        missed[start : start + 2] = -state[start + count - 1]
    assert left == pytest.approx(missed, abs=1e-13)


def test_it_is_of_third_order_on_a_periodic_motion() -> None:
    """x' = -2 x + cos t, at the ends of the steps."""
    errors = []
    for count in (32, 64, 128):
        points = radau_points(_uneven(Layout((count,))))
        states, rates = _rule(points)
        matrix = step_rule(points, points.step, states, rates).toarray()
        phase = np.asarray(points.mesh.phase)
        whole = matrix[:, :count] - 2.0 * matrix[:, count:]
        found = np.linalg.solve(whole, -matrix[:, count:] @ np.cos(phase))
        exact = (2.0 * np.cos(phase) + np.sin(phase)) / 5.0
        errors.append(np.max(np.abs(found - exact)[1::2]))
    assert errors[0] / errors[1] > 7.0
    assert errors[1] / errors[2] > 7.0


def test_a_stiff_state_follows_at_once() -> None:
    """x' = -k (x - cos t) with k h = 1e6: at every point x is cos t but for a millionth."""
    points = radau_points(uniform_mesh(Layout((32,))))
    states, rates = _rule(points)
    matrix = step_rule(points, points.step, states, rates).tocsc()
    phase, k = np.asarray(points.mesh.phase), 1e6 / points.step[0]
    found = spsolve(matrix[:, :32] - k * matrix[:, 32:], -k * (matrix[:, 32:] @ np.cos(phase)))
    assert np.max(np.abs(found - np.cos(phase))) < 1e-5
