"""Residuals against noise of known covariance, gaps against their definition."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from scipy.stats import chi2 as chi2_distribution
from scipy.stats import kstest

from savgs_ident.fit.result import (
    Fit,
    chi2_by_dwell,
    comparable,
    entries_by_dwell,
    gaps,
    peak_to_peak_sigma,
    predicted_peak_to_peak,
    whitened,
)
from savgs_ident.plants.quarter_car.plant import CHANNELS
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.responses.harmonic_response import HarmonicResponse


def test_reports_know_the_channels_of_the_model() -> None:
    assert RIG_LAYOUT.responses == tuple(each.name for each in CHANNELS)


def test_whitened_residuals_of_the_truth_are_unit_normals(fit: Fit) -> None:
    sigma = whitened(fit.measured, fit.channels, fit.predicted, fit.used)[:, :, 1:]
    assert kstest(sigma.ravel(), "norm").pvalue > 0.01
    assert abs(np.corrcoef(sigma[..., 0].ravel(), sigma[..., 1].ravel())[0, 1]) < 0.25


def test_chi2_by_dwell_is_the_quadratic_form_with_the_inverse_covariance(fit: Fit) -> None:
    residual = fit.measured.harmonics[3, 1:, 1:] - fit.predicted[3, :, 1:]
    parts = np.stack([residual.real, residual.imag], axis=-1)
    inverse = np.linalg.inv(fit.measured.covariance[3, 1:, 1:])
    by_hand = np.einsum("cki,ckij,ckj->", parts, inverse, parts)
    assert_allclose(chi2_by_dwell(fit)[3], by_hand, rtol=1e-12)
    total = float(chi2_by_dwell(fit).sum())
    assert 0.001 < chi2_distribution.cdf(total, int(entries_by_dwell(fit).sum())) < 0.999


def test_entries_that_are_not_used_are_left_open(fit: Fit) -> None:
    used = fit.used.copy()
    used[2, 1, 3] = False
    fewer = replace(fit, used=used)
    sigma = whitened(fit.measured, fit.channels, fit.predicted, used)
    assert np.isnan(sigma[2, 1, 3]).all()
    assert np.isnan(sigma[:, :, 0]).all()
    assert entries_by_dwell(fewer)[2] == entries_by_dwell(fit)[2] - 2
    assert chi2_by_dwell(fewer)[2] < chi2_by_dwell(fit)[2]


def test_a_gain_error_of_one_per_cent_is_a_gap_of_one_per_cent(fit: Fit) -> None:
    off = fit.measured.harmonics[:, 1:] * 0.99
    found = gaps(fit.measured, fit.channels, off, fit.used)
    for name in (*RIG_LAYOUT.responses, "together"):
        assert_allclose(found[name].relative, 0.01, rtol=1e-9)
    assert found["together"].sigma > 1.0


def test_the_gap_of_the_truth_is_the_noise_floor(fit: Fit) -> None:
    for gap in gaps(fit.measured, fit.channels, fit.predicted, fit.used).values():
        assert_allclose(gap.relative, gap.floor, rtol=0.35)
        assert_allclose(gap.sigma, 1.0, rtol=0.2)


def test_channels_are_pooled_with_equal_weight(fit: Fit) -> None:
    off = fit.measured.harmonics[:, 1:].copy()
    off[:, 1] *= 1.02
    assert_allclose(
        gaps(fit.measured, fit.channels, off, fit.used)["together"].relative, 0.02 / np.sqrt(2.0), rtol=1e-9
    )


def test_what_can_be_compared_has_known_noise(measured: HarmonicResponse) -> None:
    covariance = measured.covariance.copy()
    covariance[1, 1, 2] = 0.0
    valid = measured.valid.copy()
    valid[4, 2, 3:] = False
    used = comparable(replace(measured, covariance=covariance, valid=valid), RIG_LAYOUT.responses, 3)
    assert used.shape == (8, 2, 4)
    assert not used[:, :, 0].any()
    assert not used[1, 0, 2]
    assert not used[4, 1, 3]
    assert np.count_nonzero(used) == 8 * 2 * 3 - 2


def test_peak_to_peak_of_a_cosine_is_twice_its_amplitude(fit: Fit) -> None:
    alone = np.zeros_like(fit.predicted)
    alone[:, :, 1] = 0.7 - 0.2j
    reach = predicted_peak_to_peak(fit.measured, fit.channels, alone)
    assert_allclose(reach, 2.0 * abs(0.7 - 0.2j), rtol=1e-4)


def test_a_peak_to_peak_fit_counts_one_entry_a_channel(fit: Fit) -> None:
    pointwise = replace(fit, quantity="peak_to_peak")
    assert_allclose(entries_by_dwell(pointwise), 2)
    assert_allclose(chi2_by_dwell(pointwise), np.sum(peak_to_peak_sigma(fit) ** 2, axis=1))
