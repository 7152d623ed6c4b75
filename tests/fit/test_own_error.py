"""The error that campaigns have in common, against many campaigns of rigs that differ from their drawing."""

import numpy as np
import pytest

from savgs_ident.campaigns.trends import follow
from savgs_ident.fit.small_errors import own_part

PRIOR = np.array([0.5, 2.0])
SLOPES = 3.0 * np.array([[1.0, 0.9, 0.8], [0.4, 0.5, 0.3], [1.2, 1.0, 0.9], [0.3, 0.2, 0.4]])
"""Readings over (identified parameter, two known to a tolerance), noise 1."""


def _covariance() -> np.ndarray:
    return np.linalg.inv(SLOPES.T @ SLOPES + np.diag([0.0, *PRIOR**-2.0]))


def _estimates(random: np.random.Generator, rigs: int, campaigns: int) -> np.ndarray:
    """The identified parameter, whose truth is 0, in every campaign of every rig: (rigs, campaigns)."""
    truth = np.concatenate([np.zeros((rigs, 1)), PRIOR * random.standard_normal((rigs, 2))], axis=1)
    readings = truth[:, None] @ SLOPES.T + random.standard_normal((rigs, campaigns, 4))
    return (readings @ SLOPES @ _covariance())[..., 0]


def _share() -> float:
    """The share of the variance that campaigns have in common."""
    covariance = _covariance()
    return float(1.0 - own_part(covariance, np.array([np.inf, *PRIOR]))[0, 0] / covariance[0, 0])


def test_campaigns_of_a_rig_scatter_by_their_own_error_and_share_the_other() -> None:
    found = _estimates(np.random.default_rng(0), 4000, 12)
    variance = _covariance()[0, 0]
    assert 0.1 < _share() < 0.9
    assert found.var(axis=1, ddof=1).mean() == pytest.approx((1.0 - _share()) * variance, rel=0.02)
    own_of_mean = (1.0 - _share()) * variance / 12
    assert found.mean(axis=1).var() == pytest.approx(_share() * variance + own_of_mean, rel=0.06)


def test_mean_scatter_and_trend_are_right_with_the_two_parts_distinguished() -> None:
    found = _estimates(np.random.default_rng(1), 1500, 8)
    whole = _covariance()[0, 0]
    own, common = np.sqrt([(1.0 - _share()) * whole, _share() * whole])
    trends = [follow(np.arange(8.0), each, np.full(8, own), common) for each in found]
    allowed = 3.0 * np.sqrt(0.05 * 0.95 / 1500)
    assert np.mean([each.mean.scatter.beyond_errors for each in trends]) == pytest.approx(0.05, abs=allowed)
    held = np.mean([low <= 0.0 <= high for low, high in (each.mean.interval for each in trends)])
    assert held == pytest.approx(0.95, abs=allowed)
    flat = np.mean([each.line is not None and not each.line.rises_or_falls for each in trends])
    assert 0.95 - allowed < flat < 0.97 + allowed


def test_without_tolerances_all_error_is_the_campaigns_own() -> None:
    covariance = _covariance()
    np.testing.assert_array_equal(own_part(covariance, np.full(3, np.inf)), covariance)
