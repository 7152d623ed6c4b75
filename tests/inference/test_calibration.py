"""Whether the test of rank histograms is a test."""

import numpy as np
import pytest
from scipy.stats import kstest

from savgs_ident.validation.calibration import RANKED, uniformity

TRIALS = 120


def _ranks(random: np.random.Generator, skew: float) -> list[int]:
    """Ranks of truths that are ``skew`` of a deviation off the draws' middle."""
    truth = random.standard_normal((TRIALS, 1)) + skew
    return [int(each) for each in np.sum(random.standard_normal((TRIALS, RANKED)) < truth, axis=1)]


def test_right_ranks_have_uniform_probabilities() -> None:
    random = np.random.default_rng(1)
    found = [uniformity(_ranks(random, 0.0)) for _ in range(400)]
    assert kstest(found, "uniform").pvalue > 1e-3
    assert np.mean(np.array(found) < 0.05) == pytest.approx(0.05, abs=0.04)


def test_ranks_take_every_place_alike() -> None:
    """All places of a bin: forty go into eight."""
    even = [place for place in range(RANKED + 1) for _ in range(3)]
    assert uniformity(even) == pytest.approx(1.0)
    assert uniformity([*even, *[RANKED] * 60]) < 1e-10


@pytest.mark.parametrize("skew", [1.0, -1.0])
def test_skewed_ranks_are_found_out(skew: float) -> None:
    assert uniformity(_ranks(np.random.default_rng(2), skew)) < 1e-6


def test_intervals_that_are_too_narrow_are_found_out() -> None:
    random = np.random.default_rng(3)
    truth = 2.0 * random.standard_normal((TRIALS, 1))
    ranks = np.sum(random.standard_normal((TRIALS, RANKED)) < truth, axis=1)
    assert uniformity([int(each) for each in ranks]) < 1e-6
