"""What a Bode figure shows: first harmonics per metre of road and peak-to-peak values over frequency.

Models may be solved at other frequencies than those measured, so that their curves are smooth; each curve
carries its own frequencies.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.report.readings import READINGS
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.peak_to_peak import peak_to_peak


@dataclass(frozen=True)
class ModelCurve:
    """A model's response at F frequencies, channels as in :data:`READINGS`.

    Attributes:
        label: what the legend calls it.
        frequency: [Hz], (F,), increasing.
        transfer: complex first harmonic per metre of road [unit/m], (F, 2); NaN where not solved.
        peak_to_peak: [unit], (F, 2); NaN where not solved.
    """

    label: str
    frequency: NDArray[np.float64]
    transfer: NDArray[np.complex128]
    peak_to_peak: NDArray[np.float64]


@dataclass(frozen=True)
class MeasuredPoints:
    """Measured responses of D dwells with standard deviations, channels as in :data:`READINGS`.

    Attributes:
        frequency: [Hz], (D,), increasing.
        transfer: complex first harmonic per metre of road [unit/m], (D, 2); NaN where not measured.
        magnitude_sd: of its magnitude [unit/m], (D, 2).
        phase_sd: of its phase [rad], (D, 2).
        peak_to_peak: [unit], (D, 2).
        peak_to_peak_sd: [unit], (D, 2).
    """

    frequency: NDArray[np.float64]
    transfer: NDArray[np.complex128]
    magnitude_sd: NDArray[np.float64]
    phase_sd: NDArray[np.float64]
    peak_to_peak: NDArray[np.float64]
    peak_to_peak_sd: NDArray[np.float64]


def model_curve(
    label: str,
    frequency: NDArray[np.float64],
    harmonics: NDArray[np.complex128],
    road: NDArray[np.complex128],
    solved: NDArray[np.bool_],
) -> ModelCurve:
    """The curve of ``harmonics`` (F, 2, K) under a road whose first harmonics [m] are ``road`` (F,).

    Frequencies that are not ``solved`` (F,) are left open.
    """
    every = np.ones(harmonics.shape, dtype=np.bool_)
    transfer = np.where(solved[:, None], harmonics[:, :, 1] / road[:, None], np.nan)
    reach = np.where(solved[:, None], peak_to_peak(harmonics, every), np.nan)
    return ModelCurve(label, frequency, transfer, reach)


def measured_points(response: HarmonicResponse) -> MeasuredPoints:
    """The measured response as points with error bars."""
    shape = (len(response.tests), len(READINGS))
    transfer = np.full(shape, np.nan, dtype=np.complex128)
    magnitude_sd, phase_sd, reach, reach_sd = (np.full(shape, np.nan) for _ in range(4))
    road = response.harmonics[:, response.channel("road_height"), 1]
    for column, name in enumerate(READINGS):
        if name not in response.channels:
            continue
        c = response.channel(name)
        d = response.valid[:, c, 1]
        first, covariance = response.harmonics[d, c, 1], response.covariance[d, c, 1]
        along = first / np.abs(first)
        transfer[d, column] = first / road[d]
        magnitude_sd[d, column] = _deviation(covariance, along) / np.abs(road[d])
        phase_sd[d, column] = _deviation(covariance, 1j * along) / np.abs(first)
        reach[d, column], reach_sd[d, column] = response.peak_to_peak[d, c], response.peak_to_peak_sd[d, c]
    return MeasuredPoints(response.frequency, transfer, magnitude_sd, phase_sd, reach, reach_sd)


def phase_deg(transfer: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Phase of one channel over frequency [deg], (n,), without jumps, beginning within [-90, 270).

    A suspension's readings begin between 0 and 180 deg: neither end of that range is near.
    """
    known = np.isfinite(transfer)
    phase = np.full(transfer.shape, np.nan)
    if np.any(known):
        unwrapped = np.degrees(np.unwrap(np.angle(transfer[known])))
        phase[known] = unwrapped - 360.0 * np.floor((unwrapped[0] + 90.0) / 360.0)
    return phase


def _deviation(covariance: NDArray[np.float64], direction: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Standard deviation of phasors (n, 2, 2) along unit phasors (n,)."""
    unit = np.stack([direction.real, direction.imag], axis=-1)
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", unit, covariance, unit)))
