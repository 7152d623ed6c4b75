"""Trends over campaigns: known lines are found, intervals hold as often as they say, scatter is recognised."""

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.campaigns.trends import CONFIDENCE, Line, follow
from savgs_ident.core.errors import InputError

from ..in_one_test import over

DRAWS = 2000
X = np.array([0.0, 0.3, 1.0, 1.1, 2.0, 3.5, 3.6, 5.0, 6.0, 7.0])
ERRORS = np.array([1.0, 2.0, 1.0, 0.5, 1.0, 3.0, 1.0, 1.0, 0.7, 1.0])
VALUE, SLOPE = 30.0, -0.4


def _drawn(seed: int, scale: float, slope: float = SLOPE) -> NDArray[np.float64]:
    """Estimates (DRAWS, n) whose true errors are ``scale`` times those that are stated."""
    random = np.random.default_rng(seed)
    return VALUE + slope * X + scale * ERRORS * random.standard_normal((DRAWS, X.size))


def _line(y: NDArray[np.float64]) -> Line:
    line = follow(X, y, ERRORS).line
    assert line is not None
    return line


def _allowed(share: float) -> float:
    """Three standard deviations of a share of the draws."""
    return 3.0 * float(np.sqrt(share * (1.0 - share) / DRAWS))


def test_points_on_a_line_give_the_line() -> None:
    line = _line(VALUE + SLOPE * X)
    assert line.slope == pytest.approx(SLOPE, rel=1e-12)
    assert line.at(np.array([0.0, 10.0]))[0] == pytest.approx([VALUE, VALUE + 10.0 * SLOPE], rel=1e-12)
    assert line.scatter.chi2 == pytest.approx(0.0, abs=1e-20)
    assert line.scatter.widening == 1.0


def test_errors_are_those_of_weighted_least_squares() -> None:
    y = _drawn(0, 1.0)[0]
    columns = np.stack([np.ones_like(X), X], axis=1) / ERRORS[:, None]
    covariance = np.linalg.inv(columns.T @ columns)
    solution = covariance @ columns.T @ (y / ERRORS)
    line = _line(y)
    assert line.slope == pytest.approx(solution[1], rel=1e-10)
    assert line.slope_stderr == pytest.approx(np.sqrt(covariance[1, 1]), rel=1e-10)
    at = np.array([1.0, -2.0])
    sd = line.at(np.array([-2.0]))[1] / line.scatter.quantile
    assert sd == pytest.approx(np.sqrt(at @ covariance @ at), rel=1e-10)


def test_intervals_hold_as_often_as_they_say_where_the_errors_are_right() -> None:
    lines = [_line(y) for y in _drawn(1, 1.0)]
    held = np.mean([low <= SLOPE <= high for low, high in (line.slope_interval for line in lines)])
    # In the twentieth of cases that scatter by chance the interval is wider than it need be.
    assert CONFIDENCE - _allowed(CONFIDENCE) < held < CONFIDENCE + 0.02
    reach = np.array([-1.0, 4.0, 9.0])
    bands = np.array(
        [np.abs(line.at(reach)[0] - VALUE - SLOPE * reach) <= line.at(reach)[1] for line in lines]
    )
    assert np.all(bands.mean(axis=0) > CONFIDENCE - _allowed(CONFIDENCE))
    assert np.mean([line.scatter.beyond_errors for line in lines]) == pytest.approx(0.05, abs=_allowed(0.05))


def test_intervals_hold_where_the_campaigns_scatter_three_times_more_than_their_errors() -> None:
    lines = [_line(y) for y in _drawn(2, 3.0)]
    assert np.mean([line.scatter.beyond_errors for line in lines]) > 0.97
    held = np.mean([low <= SLOPE <= high for low, high in (line.slope_interval for line in lines)])
    assert held == pytest.approx(CONFIDENCE, abs=_allowed(CONFIDENCE))
    assert np.mean([line.scatter.widening for line in lines]) == pytest.approx(3.0, rel=0.05)


def test_a_mean_holds_as_often_as_it_says() -> None:
    for scale in (1.0, 3.0):
        means = [follow(X, y, ERRORS).mean for y in _drawn(3, scale, slope=0.0)]
        held = np.mean([low <= VALUE <= high for low, high in (mean.interval for mean in means)])
        assert CONFIDENCE - _allowed(CONFIDENCE) < held < CONFIDENCE + 0.02


def test_a_trend_is_no_scatter_about_its_own_line() -> None:
    trend = follow(X, VALUE + 5.0 * X, ERRORS)
    assert trend.mean.scatter.beyond_errors
    assert trend.line is not None
    assert not trend.line.scatter.beyond_errors
    assert trend.line.rises_or_falls


def test_a_slope_within_its_error_is_no_trend() -> None:
    found = np.mean([_line(y).rises_or_falls for y in _drawn(4, 1.0, slope=0.0)])
    assert found < 0.05 + _allowed(0.05)


def test_two_campaigns_have_a_line_and_no_scatter_one_has_neither() -> None:
    line = follow([0.0, 2.0], [1.0, 5.0], [0.1, 0.1]).line
    assert line is not None
    assert (line.slope, line.scatter.dof, line.scatter.widening) == (pytest.approx(2.0), 0, 1.0)
    assert line.slope_stderr == pytest.approx(np.hypot(0.1, 0.1) / 2.0)
    alone = follow([3.0], [1.0], [0.1])
    assert alone.line is None
    assert (alone.mean.value, alone.mean.stderr, alone.mean.scatter.dof) == (1.0, pytest.approx(0.1), 0)


def test_times_since_1970_and_tiny_numbers_lose_no_digits() -> None:
    start = 1.7e9
    plain, shifted = (
        follow(origin + X, 1e-9 * (VALUE + SLOPE * X), 1e-12 * ERRORS).line for origin in (0.0, start)
    )
    assert plain is not None
    assert shifted is not None
    assert shifted.slope == pytest.approx(plain.slope, rel=1e-6)
    assert shifted.slope_stderr == pytest.approx(plain.slope_stderr, rel=1e-6)


@over(
    "bad",
    [
        ([], [], []),
        ([0.0, 1.0], [1.0], [1.0]),
        ([0.0], [np.nan], [1.0]),
        ([0.0], [1.0], [np.inf]),
        ([0.0], [1.0], [0.0]),
    ],
)
def test_what_is_no_estimate_is_refused(bad: tuple[list[float], list[float], list[float]]) -> None:
    with pytest.raises(InputError, match="a trend needs"):
        follow(*bad)
