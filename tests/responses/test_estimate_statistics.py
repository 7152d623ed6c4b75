"""The estimates are unbiased and their covariance is what it says, over hundreds of draws.

All draws are dwells of one campaign, so that one call estimates them all. Limits are those of the binomial,
chi-square and F distributions at the number of draws used, beyond 1e-4 of chance.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.stats

from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, peak_to_peak

DRAWS = 120
FREQUENCY = 2.013
ORDERS = 9
Noise = Callable[[np.random.Generator, int], Any]


def draw_response(
    synthetic: Any, harmonics: Any, noise: Noise, seed: int, road_noise: float = 1e-5
) -> HarmonicResponse:
    rng = np.random.default_rng(seed)
    signals = {
        "road_height": synthetic.road(road_noise),
        "sprung_accel": synthetic.Signal(harmonics, 250.0, noise),
    }
    dwells = [synthetic.dwell(rng, signals, FREQUENCY, 6.1, name=f"dwell_{i}") for i in range(DRAWS)]
    return estimate_response(synthetic.campaign(*dwells), orders=ORDERS)


@pytest.fixture(scope="module", params=[pytest.param("white", marks=pytest.mark.slow), "coloured"])
def drawn(request: pytest.FixtureRequest, synthetic: Any) -> tuple[HarmonicResponse, Any]:
    noise = synthetic.white(0.05) if request.param == "white" else synthetic.coloured(0.05, 0.93)
    harmonics = synthetic.stepped(2.0, 40)
    return draw_response(synthetic, harmonics, noise, 1), harmonics[: ORDERS + 1]


def errors_of(response: HarmonicResponse, harmonics: Any) -> Any:
    """(Re, Im) of estimate less truth for orders 1..n of the acceleration, (D, n, 2)."""
    error = response.harmonics[:, response.channel("sprung_accel"), 1:] - harmonics[1:]
    return np.stack([error.real, error.imag], axis=-1)


def test_mean_error_lies_within_its_standard_error(drawn: tuple[HarmonicResponse, Any]) -> None:
    response, harmonics = drawn
    error = errors_of(response, harmonics)
    mean = error.mean(axis=0)
    spread = np.array([np.cov(error[:, k].T) for k in range(error.shape[1])]) / DRAWS
    statistic = sum(mean[k] @ np.linalg.solve(spread[k], mean[k]) for k in range(len(mean)))
    assert statistic < scipy.stats.chi2.isf(1e-4, 2 * ORDERS)


def test_covariance_covers(drawn: tuple[HarmonicResponse, Any]) -> None:
    response, harmonics = drawn
    error = errors_of(response, harmonics)
    c = response.channel("sprung_accel")
    covariance = response.covariance[:, c, 1:]
    distance = np.einsum("dki,dki->dk", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    assert response.covariance_dof is not None
    bound = 2.0 * scipy.stats.f.ppf(0.95, 2, response.covariance_dof[:, c, 1:])
    covered = np.count_nonzero(distance < bound)
    trials = distance.size
    low, high = scipy.stats.binom.ppf([1e-4, 1 - 1e-4], trials, 0.95)
    assert low <= covered <= high, covered / trials
    per_order = np.count_nonzero(distance < bound, axis=0)
    low, high = scipy.stats.binom.ppf([1e-5, 1 - 1e-5], DRAWS, 0.95)
    assert np.all((low <= per_order) & (per_order <= high)), per_order / DRAWS


def test_variance_is_right_on_average(drawn: tuple[HarmonicResponse, Any]) -> None:
    response, harmonics = drawn
    error = errors_of(response, harmonics)
    stated = np.trace(response.covariance[:, response.channel("sprung_accel"), 1:], axis1=-2, axis2=-1)
    ratio = np.sum(error**2, axis=-1).mean(axis=0) / stated.mean(axis=0)
    assert ratio == pytest.approx(1.0, abs=4.0 * np.sqrt(1.0 / DRAWS))
    assert float(ratio.mean()) == pytest.approx(1.0, abs=4.0 * np.sqrt(1.0 / DRAWS / ORDERS))


def test_mean_level_is_covered(drawn: tuple[HarmonicResponse, Any]) -> None:
    response, harmonics = drawn
    c = response.channel("sprung_accel")
    error = response.harmonics[:, c, 0].real - harmonics[0].real
    pull = error / np.sqrt(response.covariance[:, c, 0, 0, 0])
    covered = np.count_nonzero(np.abs(pull) < 1.96)
    low, high = scipy.stats.binom.ppf([1e-4, 1 - 1e-4], DRAWS, 0.95)
    assert low <= covered <= high, covered / DRAWS
    assert np.all(response.harmonics[:, c, 0].imag == 0.0)


def test_frequency_is_right_within_its_deviation(drawn: tuple[HarmonicResponse, Any]) -> None:
    response, _ = drawn
    pull = (response.frequency - FREQUENCY) / response.frequency_sd
    assert abs(pull.mean()) < 4.0 / np.sqrt(DRAWS)
    low, high = scipy.stats.chi2.ppf([1e-4, 1 - 1e-4], DRAWS)
    assert low < np.sum(pull**2) < high


def test_peak_to_peak_is_unbiased_and_covered(drawn: tuple[HarmonicResponse, Any]) -> None:
    response, harmonics = drawn
    c = response.channel("sprung_accel")
    truth = peak_to_peak(harmonics, np.ones(harmonics.size, dtype=np.bool_))
    pull = (response.peak_to_peak[:, c] - truth) / response.peak_to_peak_sd[:, c]
    assert abs(pull.mean()) < 0.3
    low, high = scipy.stats.binom.ppf([1e-4, 1 - 1e-4], DRAWS, 0.95)
    assert low <= np.count_nonzero(np.abs(pull) < 1.96) <= high


@pytest.mark.slow
def test_noise_bias_of_peak_to_peak_is_removed_where_it_matters(synthetic: Any) -> None:
    """A flat-topped wave in heavy noise: the raw peak-to-peak is too large, the one given is not."""
    harmonics = np.array([0.0, 1.0, 0.0, -0.12], dtype=np.complex128)
    response = draw_response(synthetic, harmonics, synthetic.white(0.5), 3)
    c = response.channel("sprung_accel")
    truth = float(peak_to_peak(harmonics, np.ones(harmonics.size, dtype=np.bool_)))
    raw = peak_to_peak(response.harmonics[:, c], response.valid[:, c])
    scatter = float(response.peak_to_peak[:, c].std())
    assert raw.mean() - truth > 10.0 * scatter / np.sqrt(DRAWS)
    assert abs(response.peak_to_peak[:, c].mean() - truth) < 0.4 * (raw.mean() - truth)


@pytest.mark.slow
def test_orders_cut_off_neither_bias_nor_count_as_noise(synthetic: Any) -> None:
    """A signal with 50 strong orders, 9 kept: the noise is the noise, in density and in one sample."""
    harmonics = synthetic.stepped(20.0, 50)
    response = draw_response(synthetic, harmonics, synthetic.white(0.05), 4, road_noise=1e-8)
    c = response.channel("sprung_accel")
    assert float(response.noise_sd[:, c].mean()) == pytest.approx(0.05, rel=0.005)
    stated = np.trace(response.covariance[:, c, 1:], axis1=-2, axis2=-1)
    alone = 4.0 * 0.05**2 / round(6.1 * 250.0)
    assert 1.0 < float(stated.mean()) / alone < 1.05, "fitting the other orders along costs next to nothing"
    error = response.harmonics[:, c, 1:] - harmonics[1 : ORDERS + 1]
    ratio = float(np.mean(np.abs(error) ** 2) / stated.mean())
    assert ratio == pytest.approx(1.0, abs=4.0 * np.sqrt(1.0 / error.size))


@pytest.mark.slow
def test_drift_does_not_bias(synthetic: Any) -> None:
    """A drift of 100 noise deviations over the record leaves the harmonics alone."""
    rng = np.random.default_rng(6)
    harmonics = synthetic.stepped(2.0, 20)
    signals = {
        "road_height": synthetic.road(),
        "sprung_accel": synthetic.Signal(harmonics, 250.0, synthetic.white(0.05), drift=5.0 / 6.1),
    }
    dwells = [synthetic.dwell(rng, signals, FREQUENCY, 6.1, name=f"dwell_{i}") for i in range(60)]
    response = estimate_response(synthetic.campaign(*dwells), orders=5)
    c = response.channel("sprung_accel")
    error = response.harmonics[:, c, 1:] - harmonics[1:6]
    variance = np.trace(response.covariance[:, c, 1:], axis1=-2, axis2=-1)
    assert np.sum(2 * np.abs(error) ** 2 / variance) < scipy.stats.chi2.isf(1e-4, error.size * 2)
