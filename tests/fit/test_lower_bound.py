"""A held parameter and its lower bound near a well identified minimum, where chi2 is a parabola."""

import numpy as np
import pytest

from savgs_ident.fit.identifiability import CHI2_95, PIN, held_at, lower_bound
from savgs_ident.fit.minimise import Minimum
from savgs_ident.plants.quarter_car.model import FREE

from .bench import TRUTH, Bench, silent


@pytest.fixture(scope="module")
def best(bench: Bench) -> Minimum:
    """The fit of one draw, which the compiled step of the bench cannot distinguish from the recorded one."""
    return bench.fit(bench.predicted(TRUTH) + bench.noise(7))


def _sd(best: Minimum, name: str) -> float:
    return float(np.sqrt(np.linalg.inv(best.jacobian.T @ best.jacobian)[FREE.index(name), FREE.index(name)]))


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


@pytest.mark.slow
def test_the_lower_bound_is_where_chi2_has_risen_by_its_95_percent_point(bench: Bench, best: Minimum) -> None:
    """To the 3 % of its bisection, which is many standard errors here: it never lies above the true bound."""
    minimiser = bench.seeing(bench.predicted(TRUTH) + bench.noise(7))
    bound = lower_bound(minimiser, best, "ydot_Hth", silent)
    assert bound is not None
    estimate = float(bench.task.problem.parameters(best.u)["ydot_Hth"])
    exact = estimate * np.exp(-np.sqrt(CHI2_95) * _sd(best, "ydot_Hth"))
    assert exact * 0.97 < bound < estimate * 1.0001
