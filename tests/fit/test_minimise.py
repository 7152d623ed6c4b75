"""The minimisation on a few dwells: exact Jacobian, honest ends, unbiased estimates with right errors."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.status import Status
from savgs_ident.fit.minimise import Minimiser, Minimum
from savgs_ident.inference.problem import ProblemSettings, plan_task
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import simulate_periodic

from .bench import TRUTH, Bench, only, silent

AWAY = (
    {"mu_r": 0.1},
    {"ydot_Hth": 0.005},
    {"mu_r": 0.001, "c_sd": 12000.0, "mu_t": 1.0},
    {"mu_t": 1.5, "ydot_Hth": 0.01},
)
"""Starts far from the truth; the first step from the last two is far too long and is rejected."""


def _still_to_gain(found: Minimum) -> float:
    """By how much a Gauss-Newton step from there would lower the sum of squares."""
    gradient = found.jacobian.T @ found.residual
    return float(gradient @ np.linalg.pinv(found.jacobian.T @ found.jacobian) @ gradient)


def _check_columns(minimiser: Minimiser, at: Minimum, step: float) -> None:
    for place, name in enumerate(minimiser.problem.free.names):
        ends = [
            minimiser.evaluate(at.u.at[place].add(side * step), at.solution).residual for side in (-1.0, 1.0)
        ]
        difference = (ends[1] - ends[0]) / (2.0 * step)
        column = at.jacobian[:, place]
        assert np.max(np.abs(difference - column)) <= 1e-5 * np.max(np.abs(column)), name


def test_the_jacobian_is_that_of_the_residuals(bench: Bench) -> None:
    u = bench.u(dict(bench.task.table.as_dict()) | {"mu_r": 0.024, "mu_t": 0.31, "c_sd": 5000.0})
    _check_columns(bench.minimiser, bench.minimiser.evaluate(u, bench.first), 1e-5)


@pytest.mark.slow
def test_the_jacobian_holds_with_tolerances_and_priors_too(few: HarmonicResponse, rig: Rig) -> None:
    three = only(few, np.isin(np.round(few.frequency, 2), (1.4, 2.35, 6.0)))
    task = plan_task(three, RigModel(rig, MODELS["simtr"]), FREE, ProblemSettings())
    problem = task.problem
    first = simulate_periodic(problem.model, problem.fixed, task.excitation)
    minimiser = Minimiser(problem)
    count, widths = len(problem.free.names), problem.free.widths
    assert {"k_sd", "k_t", "m_s", "C_y", "k_pre"} <= set(problem.free.tolerated)
    u = jnp.asarray(np.random.default_rng(3).uniform(-0.5, 0.5, count))
    at = minimiser.evaluate(u, first)
    assert at.jacobian.shape == (at.residual.size, count)
    np.testing.assert_allclose(at.residual[-count:], np.asarray(u) / widths, rtol=1e-14)
    np.testing.assert_allclose(at.jacobian[-count:], np.diag(1.0 / widths), rtol=1e-14)
    _check_columns(minimiser, at, 1e-4)


def test_clean_data_give_the_truth_back(bench: Bench) -> None:
    found = bench.fit(bench.predicted(TRUTH))
    assert found.status is Status.CONVERGED
    assert found.cost == pytest.approx(
        float(found.residual[-len(FREE) :] @ found.residual[-len(FREE) :]), abs=1e-4
    )
    values = bench.task.problem.parameters(found.u)
    assert [float(values[name]) for name in FREE] == pytest.approx([TRUTH[name] for name in FREE], rel=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("start", AWAY, ids=str)
def test_it_comes_back_from_far_away(bench: Bench, start: dict[str, float]) -> None:
    data = bench.predicted(TRUTH) + bench.noise(1)
    near, far = bench.fit(data, enough=1e-9), bench.fit(data, start, enough=1e-9)
    assert far.status is Status.CONVERGED
    assert far.cost == pytest.approx(near.cost, abs=1e-3)
    assert np.asarray(far.u) == pytest.approx(np.asarray(near.u), abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("start", [*AWAY, {"mu_t": 0.05, "ydot_Hth": 0.3}], ids=str)
def test_converged_means_that_nothing_is_left_to_gain(bench: Bench, start: dict[str, float]) -> None:
    """In whichever minimum it ends: a step that was rejected must not pass for the last one."""
    found = bench.fit(bench.predicted(TRUTH) + bench.noise(2), start)
    assert found.status is Status.CONVERGED
    assert _still_to_gain(found) < 1e-3


def test_too_few_steps_are_not_convergence(bench: Bench) -> None:
    u = bench.u(dict(bench.task.table.as_dict()) | {"mu_r": 0.1})
    cut = bench.seeing(bench.predicted(TRUTH)).minimise(u, bench.first, 2, silent)
    assert cut.status is Status.MAX_ITERATIONS
    assert _still_to_gain(cut) > 1.0


def test_data_that_are_not_numbers_are_not_convergence(bench: Bench) -> None:
    broken = bench.predicted(TRUTH).copy()
    broken[0, 0, 1] = np.nan
    assert bench.fit(broken).status is Status.NOT_FINITE


@pytest.mark.slow
def test_estimates_are_unbiased_and_their_errors_right(bench: Bench) -> None:
    """Forty draws of the noise: pulls of mean zero and variance one, chi2 as many as degrees of freedom."""
    draws, clean = 40, bench.predicted(TRUTH)
    truth = np.asarray(bench.u(dict(bench.task.table.as_dict()) | dict(TRUTH)))
    pulls, costs = [], []
    for seed in range(draws):
        found = bench.fit(clean + bench.noise(seed))
        assert found.status is Status.CONVERGED
        covariance = np.linalg.inv(found.jacobian.T @ found.jacobian)
        pulls.append((np.asarray(found.u) - truth) / np.sqrt(np.diag(covariance)))
        costs.append(found.cost)
    mean, square = np.mean(pulls, axis=0), np.mean(np.square(pulls), axis=0)
    assert np.max(np.abs(mean)) < 3.0 / np.sqrt(draws)
    assert np.max(np.abs(square - 1.0)) < 3.0 * np.sqrt(2.0 / draws)
    dof = bench.task.problem.target.entries - len(FREE)
    assert abs(np.mean(costs) - dof) < 3.0 * np.sqrt(2.0 * dof / draws)
