"""A dwell that was not found is named; one that was is the same however it was found."""

import numpy as np
import pytest

from savgs_ident.core.status import Status
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    resolve,
    simulate_periodic,
    solve_on_mesh,
)

from .programme import FEW, altered, cam, distance, orders


def _same_nodes(model: QuarterCar, p: Values, solution: PeriodicSolution) -> PeriodicSolution:
    """A cold start on the nodes of ``solution``: at rest, far from any periodic motion."""
    rest = type(solution.trajectory)(*(0.0 * part for part in solution.trajectory))
    limit = PeriodicSettings.iterations
    return solve_on_mesh(model, p, solution.excitation, solution.mesh, rest, limit)


@pytest.mark.slow
def test_a_dwell_cut_off_at_the_iteration_limit_says_so(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution
) -> None:
    settings = PeriodicSettings(iterations=2, adaptations=0)
    cut = simulate_periodic(friction, numbers, cam(FEW), settings)
    assert cut.status() == (Status.MAX_ITERATIONS,) * FEW.size
    assert np.min(distance(orders(friction, numbers, cut), orders(friction, numbers, few))) > 1e-3


@pytest.mark.slow
def test_dwells_end_each_in_their_own_way(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution
) -> None:
    """Ten iterations serve the fastest dwell but not the slow ones, which stick for long."""
    cut = simulate_periodic(friction, numbers, cam(FEW), PeriodicSettings(iterations=10, adaptations=0))
    assert cut.status()[-1] is Status.CONVERGED
    assert Status.MAX_ITERATIONS in cut.status()[:-1]
    full = simulate_periodic(friction, numbers, cam(FEW), PeriodicSettings(adaptations=0))
    assert all(status.ok for status in full.status())
    wrong = distance(orders(friction, numbers, cut), orders(friction, numbers, full))
    for status, each in zip(cut.status(), wrong, strict=True):
        assert np.max(each) < 1e-12 if status.ok else np.max(each) > 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    "absurd",
    [{"k_sd": 1576.14}, {"k_sd": 15761.4}, {"m_s": -320.0}, {"l_free": 0.3}, {"k_t": 275.0}],
    ids=str,
)
def test_an_absurd_rig_has_no_motion_and_says_so(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution, absurd: dict[str, float]
) -> None:
    """A spring that cannot carry the mass, a mass that falls upwards, a strut that is too short."""
    p = altered(numbers, absurd)
    for found in (simulate_periodic(friction, p, cam(FEW)), resolve(friction, p, few)):
        assert not any(status.ok for status in found.status())


@pytest.mark.slow
def test_a_stuck_rig_is_a_solution_too(friction: QuarterCar, numbers: Values) -> None:
    """With so much rail friction the sprung mass never slides, it only moves as its bristle stretches."""
    p = altered(numbers, {"mu_r": 0.5})
    stuck = simulate_periodic(friction, p, cam(FEW))
    assert all(status.ok for status in stuck.status())
    swing = np.abs(orders(friction, p, stuck)[:, 0, 1]) / (2.0 * np.pi * FEW) ** 2
    assert np.all(swing < 2000.0 / float(p["k_pre"]))


@pytest.mark.slow
def test_a_warm_start_finds_what_a_cold_one_finds(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution
) -> None:
    p = altered(numbers, {"mu_r": 0.033, "mu_t": 0.22, "c_sd": 5500.0, "k_t": 2.6e5})
    warm = resolve(friction, p, few)
    cold = _same_nodes(friction, p, few)
    assert all(status.ok for status in (*warm.status(), *cold.status()))
    assert np.max(distance(orders(friction, p, warm), orders(friction, p, cold))) < 1e-11
    anew = simulate_periodic(friction, p, cam(FEW))
    assert np.max(distance(orders(friction, p, warm), orders(friction, p, anew))) < 1e-3


@pytest.mark.slow
def test_the_order_of_the_dwells_does_not_matter(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution
) -> None:
    turned = simulate_periodic(friction, numbers, cam(FEW[::-1]))
    here, there = orders(friction, numbers, turned)[::-1], orders(friction, numbers, few)
    assert np.max(distance(here, there)) < 1e-11


@pytest.mark.slow
def test_a_dwell_does_not_depend_on_its_company(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution, programme: PeriodicSolution
) -> None:
    places = np.flatnonzero(np.isin(np.asarray(programme.excitation.frequency), FEW))
    here, there = orders(friction, numbers, programme)[places], orders(friction, numbers, few)
    assert np.max(distance(here, there)) < 1e-11
