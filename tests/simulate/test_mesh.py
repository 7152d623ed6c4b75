"""Nodes that follow the accelerations, and sums over them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.simulate.mesh import (
    CHUNK,
    Layout,
    Mesh,
    adapted_mesh,
    layout_for,
    places_between,
    uniform_mesh,
)

FREQUENCY = np.array([0.5, 2.0, 6.0])
JUMPS = np.array([1.0, 1.0 + np.pi])
"""Phases at which the accelerations turn round."""


def _rounded_steps(mesh: Mesh, steepness: float) -> NDArray[np.float64]:
    """An acceleration with two quick changes a period, as a rail that sticks leaves it, and a smooth one."""
    phase = np.asarray(mesh.phase)
    sticking = np.tanh(steepness * np.sin(phase - JUMPS[0])) + 0.2 * np.cos(phase)
    return np.stack([sticking, np.cos(phase)])


def _adapted(steepness: float, nodes: int = 256) -> Mesh:
    layout = layout_for(FREQUENCY, nodes, 1.4)
    mesh = uniform_mesh(layout)
    return adapted_mesh(mesh, _rounded_steps(mesh, steepness), FREQUENCY, layout)


def _check(mesh: Mesh) -> None:
    phase, gap, weight = (np.asarray(part) for part in mesh[1:])
    for dwell, count in enumerate(mesh.layout.counts):
        mine = mesh.layout.dwell == dwell
        assert phase[mine][0] == 0.0
        assert np.all(gap[mine] > 0.0)
        assert phase[mine] == pytest.approx(np.cumsum(gap[mine]) - gap[mine], abs=1e-12)
        assert np.sum(gap[mine]) == pytest.approx(2.0 * np.pi, abs=1e-12)
        assert np.sum(weight[mine]) == pytest.approx(1.0, abs=1e-13)
        assert np.all(weight[mine] > 0.0)
        assert np.max(weight[mine]) < 4.0 / count


@given(seed=st.integers(0, 2**32 - 1), roughness=st.integers(1, 40))
def test_phases_grow_gaps_close_the_period_and_weights_share_it(seed: int, roughness: int) -> None:
    """For whatever accelerations: here random ones of few or many harmonics."""
    rng = np.random.default_rng(seed)
    layout = layout_for(FREQUENCY, 64, 1.0)
    mesh = uniform_mesh(layout)
    waves = np.exp(1j * np.arange(1, roughness + 1) * np.asarray(mesh.phase)[:, None])
    accelerations = (waves @ rng.standard_normal((roughness, 2))).real.T
    adapted = adapted_mesh(mesh, accelerations, FREQUENCY, layout)
    _check(mesh)
    _check(adapted)


def test_a_rig_at_rest_gets_equal_steps() -> None:
    mesh = uniform_mesh(layout_for(FREQUENCY, 64, 1.4))
    still = np.zeros((2, mesh.layout.total))
    adapted = adapted_mesh(mesh, still, FREQUENCY, mesh.layout)
    assert adapted.phase == pytest.approx(mesh.phase, abs=1e-12)
    assert adapted.weight == pytest.approx(mesh.weight, rel=1e-9)


def test_the_units_of_the_accelerations_do_not_matter() -> None:
    layout = layout_for(FREQUENCY, 64, 1.4)
    mesh = uniform_mesh(layout)
    accelerations = _rounded_steps(mesh, 30.0)
    here = adapted_mesh(mesh, accelerations, FREQUENCY, layout)
    there = adapted_mesh(mesh, accelerations * np.array([[1e-3], [57.3]]), FREQUENCY, layout)
    assert there.phase == pytest.approx(here.phase, abs=1e-9)


@pytest.mark.parametrize("dwell", range(FREQUENCY.size))
def test_nodes_gather_where_the_acceleration_jumps(dwell: int) -> None:
    """Half the nodes follow the accelerations, of which one of two jumps: a quarter gathers there."""
    mesh = _adapted(300.0)
    mine = mesh.layout.dwell == dwell
    phase, count = np.asarray(mesh.phase)[mine], mesh.layout.counts[dwell]
    near = np.min(np.abs(np.angle(np.exp(1j * (phase[:, None] - JUMPS)))), axis=1) < 0.12
    evenly = count * 4.0 * 0.12 / (2.0 * np.pi)
    assert np.sum(near) > evenly / 2.0 + 0.15 * count
    gap = np.asarray(mesh.gap)[mine]
    assert np.max(gap[~near]) < 2.1 * 2.0 * np.pi / count
    assert np.min(gap[near]) < 0.25 * np.max(gap)


def test_a_reversal_takes_a_time_not_a_share_of_the_period() -> None:
    """Nodes gather within two standard deviations of 3 ms, or of a 160th of a short period, of the jump."""
    mesh = _adapted(3000.0, nodes=512)
    for dwell, frequency in enumerate(FREQUENCY):
        mine = mesh.layout.dwell == dwell
        phase, count = np.asarray(mesh.phase)[mine], mesh.layout.counts[dwell]
        away = np.abs(np.angle(np.exp(1j * (phase - JUMPS[0])))) / (2.0 * np.pi * frequency)
        reach = 2.0 * min(3e-3, 1.0 / (160.0 * frequency))
        assert np.sum(away < reach) > 0.07 * count
        assert np.sum(away < 4.0 * reach) - np.sum(away < 2.0 * reach) < 0.06 * count


@pytest.mark.parametrize("steepness", [3.0, 300.0])
def test_sums_over_adapted_nodes_are_as_good_as_on_equal_ones(steepness: float) -> None:
    """Harmonics of a known Fourier series come back to rounding once the map of the nodes is resolved."""
    mesh = _adapted(steepness, nodes=512)
    rng = np.random.default_rng(2)
    wanted = rng.standard_normal(12) + 1j * rng.standard_normal(12)
    wanted[0] = wanted[0].real
    order = np.arange(12)
    phase, weight = np.asarray(mesh.phase), np.asarray(mesh.weight)
    series = np.sum(wanted * np.exp(1j * order * phase[:, None]), axis=1).real
    for dwell in range(FREQUENCY.size):
        mine = mesh.layout.dwell == dwell
        kernel = np.exp(-1j * order * phase[mine, None]) * weight[mine, None]
        found = np.where(order == 0, 1.0, 2.0) * (series[mine] @ kernel)
        assert found == pytest.approx(wanted, abs=1e-6)


@given(st.lists(st.integers(1, 3), min_size=1, max_size=4), st.integers(0, 2**31))
def test_nodes_lie_between_those_of_another_mesh_as_interpolation_has_it(
    chunks: list[int], seed: int
) -> None:
    random, layout = np.random.default_rng(seed), Layout(tuple(CHUNK * each for each in chunks))
    before, after = (
        adapted_mesh(
            uniform_mesh(layout), random.standard_normal((2, layout.total)), np.ones(len(chunks)), layout
        )
        for _ in range(2)
    )
    values = random.standard_normal(layout.total)
    place, share = places_between(before, after)
    found = values[place] + share * (values[layout.following[place]] - values[place])
    for dwell in range(len(chunks)):
        mine = layout.dwell == dwell
        wanted, known = np.asarray(after.phase)[mine], np.asarray(before.phase)[mine]
        expected = np.interp(wanted, known, values[mine], period=2.0 * np.pi)
        np.testing.assert_allclose(found[mine], expected, atol=1e-9)
