"""The log density of complex harmonics against the bivariate normal that it is said to be."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from savgs_ident.inference.likelihood import Likelihood, likelihood_of
from savgs_ident.inference.prior import Scales
from savgs_ident.inference.targets import HarmonicTarget
from savgs_ident.plants.quarter_car.plant import CHANNELS

from ..in_one_test import over
from .toy import covariances

SHAPE = (3, 2, 4)
USED = np.ones(SHAPE, dtype=bool)
USED[:, :, 0] = False
USED[1, 0, 1] = False
USED[2, 1, 3] = False
"""Not compared: the means, a first harmonic, a third one."""

RANDOM = np.random.default_rng(11)
COVARIANCE = covariances(RANDOM, SHAPE, 0.1)


def _complex() -> np.ndarray:
    return np.asarray(RANDOM.standard_normal(SHAPE) + 1j * RANDOM.standard_normal(SHAPE))


MEASURED = np.where(USED, _complex(), 0.0)


@pytest.fixture(scope="module")
def likelihood() -> Likelihood:
    whitening = np.linalg.inv(np.linalg.cholesky(COVARIANCE)) * USED[..., None, None]
    return likelihood_of(HarmonicTarget(jnp.asarray(MEASURED), jnp.asarray(whitening), USED, (1, 2), ()))


def _reach(dwell: int, channel: int, order: int) -> float:
    sizes = np.abs(MEASURED[dwell, channel])
    first = sizes[1] if USED[dwell, channel, 1] else sizes.max()
    return float(first / np.sqrt(2.0) / order ** (1, 2)[channel])


def _by_scipy(predicted: np.ndarray, noise: float, miss: float) -> float:
    total = 0.0
    for place in zip(*np.nonzero(USED), strict=True):
        spread = noise**2 * COVARIANCE[place] + (miss * _reach(*place)) ** 2 * np.eye(2)
        off = predicted[place] - MEASURED[place]
        total += multivariate_normal.logpdf([off.real, off.imag], cov=spread)
    return total


@over("a", [-1.0, 0.0, 2.0])
@over("b", [0.0, -0.7, 3.0])
def test_the_density_is_that_of_correlated_phasors(likelihood: Likelihood, a: float, b: float) -> None:
    predicted = MEASURED + 0.1 * _complex()
    found = likelihood(likelihood.rows(jnp.asarray(predicted)), jnp.array([0.0, a, b]))
    # Its constant is that of the noise alone: det C is the product of the rows' variances.
    constant = 0.5 * np.sum(np.log(2.0 * np.pi * np.asarray(likelihood.variance)))
    assert float(found) == pytest.approx(
        _by_scipy(predicted, np.exp(0.1 * a), 0.05 * abs(b)) + constant, rel=1e-10
    )


def test_entries_that_are_not_used_do_not_matter(likelihood: Likelihood) -> None:
    predicted = _complex()
    other = np.where(USED, predicted, 1e6)
    one, two = (np.asarray(likelihood.rows(jnp.asarray(each))) for each in (predicted, other))
    np.testing.assert_array_equal(one, two)
    assert one.size == 2 * USED.sum()


def test_rows_are_harmonics_turned(likelihood: Likelihood) -> None:
    predicted = np.stack([_complex(), _complex()])
    rows = np.stack([np.asarray(likelihood.rows(jnp.asarray(each))) for each in predicted])
    np.testing.assert_allclose(likelihood.harmonics(rows, SHAPE), np.where(USED, predicted, 0.0), atol=1e-12)


def test_rows_are_uncorrelated(likelihood: Likelihood) -> None:
    noise = np.linalg.cholesky(COVARIANCE) @ np.random.default_rng(1).standard_normal((20000, *SHAPE, 2, 1))
    phasors = noise[..., 0, 0] + 1j * noise[..., 1, 0]
    parts = np.stack([phasors.real, phasors.imag], axis=-1)
    turned = np.einsum("dckij,sdckj->sdcki", np.asarray(likelihood.axes), parts)
    rows = turned.reshape(20000, -1)[:, likelihood.place]
    covariance = np.cov(rows.T) / np.sqrt(np.outer(likelihood.variance, likelihood.variance))
    assert np.abs(covariance - np.eye(len(covariance))).max() < 5.0 / np.sqrt(20000) * np.sqrt(2.0)


def test_the_discrepancy_falls_with_the_order_as_the_channel_says(likelihood: Likelihood) -> None:
    assert [each.decay for each in CHANNELS] == [1, 2]
    point = jnp.array([0.0, 0.0, 1.0])
    extra = np.asarray(likelihood.spread(point)) - np.asarray(likelihood.variance)
    by_entry = np.sqrt(extra[::2]) / 0.05
    true = [_reach(*place) for place in zip(*np.nonzero(USED), strict=True)]
    np.testing.assert_allclose(by_entry, true, rtol=1e-9)
    np.testing.assert_allclose(extra[::2], extra[1::2], rtol=1e-9)


def test_scales_are_lognormal_and_halfnormal() -> None:
    scales = Scales(noise_trust=0.2, discrepancy=0.03)
    points = jnp.asarray([[9.0, 1.0, -2.0], [9.0, 0.0, 0.0], [9.0, -3.0, 0.5]])
    np.testing.assert_allclose(scales.noise_scale(points), np.exp([0.2, 0.0, -0.6]))
    np.testing.assert_allclose(scales.miss(points), [0.06, 0.0, 0.015])
