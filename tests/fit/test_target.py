"""Residuals: standard deviations of what was measured, and only of what was."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.inference.targets import Target, harmonic_target, peak_to_peak_target
from savgs_ident.plants.quarter_car.plant import CHANNELS
from savgs_ident.responses.harmonic_response import HarmonicResponse


def _at(response: HarmonicResponse) -> np.ndarray:
    """Its own harmonics of the response channels, (D, 2, n + 1)."""
    return response.harmonics[:, [response.channel(each.name) for each in CHANNELS]]


def test_what_was_measured_has_no_residual(few: HarmonicResponse) -> None:
    target = harmonic_target(few, CHANNELS, 9)
    assert np.max(np.abs(np.asarray(target(_at(few))))) == 0.0
    assert target.entries == len(few.tests) * 2 * 9 * 2
    assert np.asarray(target(_at(few))).size == target.size


def test_the_sum_of_squares_is_the_distance_in_the_covariance(few: HarmonicResponse) -> None:
    """Against inverse covariances, entry by entry; the mean does not count."""
    rng = np.random.default_rng(0)
    shape = _at(few).shape
    miss = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    residual = np.asarray(harmonic_target(few, CHANNELS, 9)(_at(few) + miss))
    wanted = 0.0
    for dwell in range(shape[0]):
        for place, name in enumerate(each.name for each in CHANNELS):
            for order in range(1, shape[2]):
                covariance = few.covariance[dwell, few.channel(name), order]
                parts = np.array([miss[dwell, place, order].real, miss[dwell, place, order].imag])
                wanted += parts @ np.linalg.solve(covariance, parts)
    assert residual @ residual == pytest.approx(wanted, rel=1e-9)


def test_what_is_not_valid_is_not_compared(few: HarmonicResponse) -> None:
    valid = few.valid.copy()
    place = few.channel("sprung_accel")
    valid[2, place, 4:] = False
    partly = replace(few, valid=valid)
    target = harmonic_target(partly, CHANNELS, 9)
    assert target.entries == harmonic_target(few, CHANNELS, 9).entries - 2 * 6
    moved = _at(few).copy()
    moved[2, 0, 4:] += 1.0
    assert np.max(np.abs(np.asarray(target(moved)))) == 0.0


def test_fewer_orders_may_be_compared_than_were_measured(few: HarmonicResponse) -> None:
    assert harmonic_target(few, CHANNELS, 3).used.shape == (len(few.tests), 2, 4)
    assert harmonic_target(few, CHANNELS, 30).used.shape == (len(few.tests), 2, few.orders + 1)


def _without(response: HarmonicResponse, *names: str) -> HarmonicResponse:
    kept = [place for place, name in enumerate(response.channels) if name not in names]
    fields = ("harmonics", "covariance", "valid", "peak_to_peak", "peak_to_peak_sd", "noise_sd")
    less = {name: getattr(response, name)[:, kept] for name in fields}
    known = None if response.covariance_dof is None else response.covariance_dof[:, kept]
    channels = tuple(response.channels[place] for place in kept)
    return replace(response, channels=channels, covariance_dof=known, **less)


def test_one_channel_is_enough(few: HarmonicResponse) -> None:
    less = _without(few, "sprung_accel")
    target = harmonic_target(less, CHANNELS, 9)
    assert target.entries == harmonic_target(few, CHANNELS, 9).entries // 2
    assert not np.any(np.asarray(target.used)[:, 0])
    moved = _at(few).copy()
    moved[:, 0] += 1.0
    assert np.max(np.abs(np.asarray(target(moved)))) == 0.0
    assert peak_to_peak_target(less, CHANNELS).entries == len(few.tests)


@pytest.mark.parametrize(
    "make",
    [lambda each: harmonic_target(each, CHANNELS, 9), lambda each: peak_to_peak_target(each, CHANNELS)],
)
def test_without_both_there_is_nothing_to_fit(
    few: HarmonicResponse, make: Callable[[HarmonicResponse], Target]
) -> None:
    with pytest.raises(InputError, match="neither sprung_accel nor susp_deflection"):
        make(_without(few, *(each.name for each in CHANNELS)))


@pytest.mark.parametrize(
    "make",
    [lambda each: harmonic_target(each, CHANNELS, 9), lambda each: peak_to_peak_target(each, CHANNELS)],
)
def test_nothing_usable_is_refused(few: HarmonicResponse, make: Callable[[HarmonicResponse], Target]) -> None:
    with pytest.raises(InputError, match="can be used"):
        make(replace(few, valid=np.zeros_like(few.valid)))


def test_peak_to_peak_counts_in_its_own_standard_deviations(few: HarmonicResponse) -> None:
    """Twice the waveform is off by its own peak-to-peak; a shifted mean changes nothing."""
    target = peak_to_peak_target(few, CHANNELS)
    base = np.asarray(target(_at(few))).reshape(-1, 2)
    double = np.asarray(target(2.0 * _at(few))).reshape(-1, 2)
    places = [few.channel(each.name) for each in CHANNELS]
    reach, sd = few.peak_to_peak[:, places], few.peak_to_peak_sd[:, places]
    assert double - 2.0 * base == pytest.approx(reach / sd, rel=1e-9)
    assert np.max(np.abs(base) * sd / reach) < 0.01
    moved = _at(few).copy()
    moved[:, :, 0] += 5.0
    assert np.asarray(target(moved)).reshape(-1, 2) == pytest.approx(base, abs=1e-9)
