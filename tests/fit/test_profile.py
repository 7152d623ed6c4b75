"""Profile likelihood near a well identified minimum, where it is a parabola of the standard error's width."""

import numpy as np
import pytest

from savgs_ident.fit.identifiability import CHI2_95, PIN, held_at, lower_bound, profile_likelihood
from savgs_ident.fit.minimise import Minimum
from savgs_ident.plants.quarter_car.model import FREE

from .bench import TRUTH, Bench, silent


@pytest.fixture(scope="module")
def best(bench: Bench) -> Minimum:
    """The fit of one draw, which the compiled step of the bench cannot distinguish from the recorded one."""
    return bench.fit(bench.predicted(TRUTH) + bench.noise(7))


def _sd(best: Minimum, name: str) -> float:
    return float(np.sqrt(np.linalg.inv(best.jacobian.T @ best.jacobian)[FREE.index(name), FREE.index(name)]))


@pytest.mark.parametrize("name", FREE)
def test_it_is_least_at_the_estimate_and_curved_as_its_error_says(
    bench: Bench, best: Minimum, name: str
) -> None:
    minimiser = bench.seeing(bench.predicted(TRUTH) + bench.noise(7))
    middle, sd = float(best.u[FREE.index(name)]), _sd(best, name)
    distances = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    profile = profile_likelihood(minimiser, best, name, middle + sd * distances, silent)
    assert profile.name == name
    assert profile.best == best.cost
    assert len(profile.points) == 5
    assert all(point.status.ok for point in profile.points)
    assert np.all(np.diff([point.value for point in profile.points]) > 0.0)
    rises = np.array([point.chi2 for point in profile.points]) - best.cost
    estimate = float(bench.task.problem.parameters(best.u)[name])
    slope = float(bench.task.problem.slopes(best.u)[FREE.index(name)])
    away = np.array([point.value - estimate for point in profile.points]) / (slope * sd)
    assert np.min(np.abs(away[[0, 1, 3, 4]])) > 0.4
    assert rises == pytest.approx(away**2, rel=0.1, abs=2e-3)
    assert rises + rises[::-1] == pytest.approx(away**2 + away[::-1] ** 2, rel=0.02, abs=4e-3)
    assert profile.points[2].value == pytest.approx(estimate, rel=1e-6)


def test_a_held_parameter_stays_about_where_it_is_held_and_the_others_follow(
    bench: Bench, best: Minimum
) -> None:
    minimiser = bench.seeing(bench.predicted(TRUTH) + bench.noise(7))
    place, sd = FREE.index("mu_t"), _sd(best, "mu_t")
    wanted = float(best.u[place]) + 3.0 * sd
    found = held_at(minimiser, best, "mu_t", wanted, silent)
    gave_way = (wanted - float(found.u[place])) / sd
    assert 0.0 < gave_way < 4.0 / (sd * PIN) ** 2
    covariance = np.linalg.inv(best.jacobian.T @ best.jacobian)
    follow = np.asarray(best.u) + covariance[:, place] * (3.0 - gave_way) / sd
    errors = np.sqrt(np.diag(covariance))
    assert np.max(np.abs(np.asarray(found.u) - follow) / errors) < 0.1


def test_the_lower_bound_is_where_chi2_has_risen_by_its_95_percent_point(bench: Bench, best: Minimum) -> None:
    """To the 3 % of its bisection, which is many standard errors here: it never lies above the true bound."""
    minimiser = bench.seeing(bench.predicted(TRUTH) + bench.noise(7))
    bound = lower_bound(minimiser, best, "ydot_Hth", silent)
    assert bound is not None
    estimate = float(bench.task.problem.parameters(best.u)["ydot_Hth"])
    exact = estimate * np.exp(-np.sqrt(CHI2_95) * _sd(best, "ydot_Hth"))
    assert exact * 0.97 < bound < estimate * 1.0001
