"""Crank-Nicolson steps leave their density as it is, in both directions of time."""

import jax
import numpy as np
import pytest
from scipy import stats

from savgs_ident.inference.samplers.emcee import pcn_steps

from .hill import SkewHill, a_normal_hill, assert_reversible

CHAINS = 20_000


@pytest.fixture(scope="module")
def skew() -> SkewHill:
    return SkewHill(2.0)


@pytest.fixture(scope="module")
def pairs(skew: SkewHill) -> tuple[np.ndarray, np.ndarray]:
    """Where short chains begin, as independent draws, and where they end, (CHAINS, 2) both."""
    start = skew.draws(np.random.default_rng(3), CHAINS)
    return start, pcn_steps(skew, 5, start)[0]


@pytest.mark.slow
def test_long_chains_have_mean_and_covariance_of_a_normal_density() -> None:
    hill = a_normal_hill(3)
    end, _, _ = pcn_steps(hill, 4, np.zeros((CHAINS, 3)), rounds=4)
    covariance = np.linalg.inv(np.asarray(hill.precision))
    sd = np.sqrt(np.diag(covariance))
    assert np.abs((end.mean(axis=0) - np.asarray(hill.centre)) / sd).max() < 4.0 / np.sqrt(CHAINS)
    # The variance of an element of a normal sample covariance is (c_ij^2 + c_ii c_jj) / N.
    error = np.sqrt((covariance**2 + np.outer(sd**2, sd**2)) / CHAINS)
    assert (np.abs(np.cov(end.T) - covariance) / error).max() < 4.0
    # A density that is not the unit normal, or the last comparison says nothing.
    assert np.abs(covariance - np.eye(3)).max() > 0.3


def test_a_density_that_is_not_normal_stays(skew: SkewHill, pairs: tuple[np.ndarray, np.ndarray]) -> None:
    start, end = pairs
    gumbel = stats.loggamma(skew.index)
    assert stats.kstest(end[:, 0], gumbel.cdf).pvalue > 1e-3
    assert stats.kstest((end[:, 1] - end[:, 0]) / 0.6, "norm").pvalue > 1e-3
    assert np.mean(np.any(start != end, axis=1)) > 0.99


def test_the_steps_are_reversible(pairs: tuple[np.ndarray, np.ndarray]) -> None:
    assert_reversible(*pairs)


def test_the_densities_are_those_at_both_ends(skew: SkewHill) -> None:
    start = skew.draws(np.random.default_rng(6), 10)
    end, before, after = pcn_steps(skew, 7, start)
    np.testing.assert_allclose(before, jax.vmap(skew)(start), rtol=1e-12)
    np.testing.assert_allclose(after, jax.vmap(skew)(end), rtol=1e-12)


def test_a_seed_gives_the_same_chain_and_another_one_another(skew: SkewHill) -> None:
    start = skew.draws(np.random.default_rng(9), 10)
    one, again, other = (pcn_steps(skew, seed, start)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.all(one != other)
