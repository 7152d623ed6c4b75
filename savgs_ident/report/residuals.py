"""What a model leaves unexplained, in noise standard deviations and as a share of the response.

An entry x = (Re, Im) of a measured harmonic with covariance C is whitened by the Cholesky factor L of C:
L^-1 (x - predicted) is, for a true model, two independent unit normals. The gap of a channel over a set of
entries is their relative rms, sqrt(sum |r|^2 / sum |x|^2), and the rms of the whitened residuals; channels
are pooled with equal weight, each relative to its own signal.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.fit.result import Fit
from savgs_ident.report.readings import READINGS
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.peak_to_peak import peak_to_peak


@dataclass(frozen=True)
class Gap:
    """Relative rms residual [1], what the noise alone leaves of it [1], and the rms in noise sd [1]."""

    relative: float
    floor: float
    sigma: float


def whitened(
    measured: HarmonicResponse, predicted: NDArray[np.complex128], used: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Residuals of (Re, Im) in noise standard deviations, (D, 2, K, 2); NaN where an entry is not used.

    ``predicted`` and ``used`` are (D, 2, K), channels as in :data:`READINGS`, orders 0..K-1.
    """
    orders = predicted.shape[2]
    residual = _readings_of(measured, measured.harmonics)[..., :orders] - predicted
    covariance = _readings_of(measured, measured.covariance)[:, :, :orders]
    parts = np.stack([residual.real, residual.imag], axis=-1)
    out = np.full(parts.shape, np.nan)
    factor = np.linalg.cholesky(covariance[used])
    out[used] = np.linalg.solve(factor, parts[used][..., None])[..., 0]
    return out


def comparable(measured: HarmonicResponse, orders: int) -> NDArray[np.bool_]:
    """The entries that a model can be held against, (D, 2, orders + 1): with noise known, not the mean."""
    kept = slice(0, orders + 1)
    noise = np.linalg.det(_readings_of(measured, measured.covariance)[:, :, kept])
    used = _readings_of(measured, measured.valid)[:, :, kept] & np.isfinite(noise) & (noise > 0.0)
    used[..., 0] = False
    return np.asarray(used)


def gaps(
    measured: HarmonicResponse, predicted: NDArray[np.complex128], used: NDArray[np.bool_]
) -> dict[str, Gap]:
    """The gap between the measured response and a prediction, by channel and "together".

    Prediction [unit of the reading] and ``used`` are (D, 2, K).
    """
    orders = predicted.shape[2]
    sigma = whitened(measured, predicted, used)
    harmonics = _readings_of(measured, measured.harmonics)[..., :orders]
    spread = np.trace(_readings_of(measured, measured.covariance)[:, :, :orders], axis1=-2, axis2=-1)
    found = {}
    for c, name in enumerate(READINGS):
        entries = used[:, c]
        if np.any(entries):
            power = np.sum(np.abs(harmonics[:, c][entries]) ** 2)
            miss = np.sum(np.abs(harmonics[:, c] - predicted[:, c])[entries] ** 2)
            noise = np.sum(spread[:, c][entries])
            rms = np.sqrt(np.mean(sigma[:, c][entries] ** 2))
            found[name] = Gap(float(np.sqrt(miss / power)), float(np.sqrt(noise / power)), float(rms))
    return found | {"together": _pooled(list(found.values()))}


def chi2_by_dwell(fit: Fit) -> NDArray[np.float64]:
    """The share of each dwell in chi2, (D,)."""
    if fit.quantity == "peak_to_peak":
        return np.asarray(np.nansum(peak_to_peak_sigma(fit) ** 2, axis=1))
    return np.asarray(np.nansum(whitened(fit.measured, fit.predicted, fit.used) ** 2, axis=(1, 2, 3)))


def entries_by_dwell(fit: Fit) -> NDArray[np.int64]:
    """How many real data entries of each dwell were fitted, (D,)."""
    if fit.quantity == "peak_to_peak":
        return np.asarray(np.sum(np.any(fit.used, axis=2), axis=1))
    return np.asarray(2 * np.sum(fit.used, axis=(1, 2)))


def predicted_peak_to_peak(
    measured: HarmonicResponse, predicted: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Peak to peak of a prediction [unit of the channel], (D, 2), with the orders that were measured."""
    valid = _readings_of(measured, measured.valid)[..., : predicted.shape[2]]
    return peak_to_peak(predicted, valid)


def peak_to_peak_sigma(fit: Fit) -> NDArray[np.float64]:
    """Peak-to-peak residuals in their standard deviations, (D, 2); NaN where a channel is not used."""
    measured = _readings_of(fit.measured, fit.measured.peak_to_peak)
    deviation = _readings_of(fit.measured, fit.measured.peak_to_peak_sd)
    used = np.any(fit.used, axis=2)
    out = np.full(used.shape, np.nan)
    residual = measured - predicted_peak_to_peak(fit.measured, fit.predicted)
    out[used] = residual[used] / deviation[used]
    return out


def _readings_of(measured: HarmonicResponse, field: NDArray[Any]) -> NDArray[Any]:
    """The rows of :data:`READINGS` out of a field (D, C, ...); zeros for a channel that was not recorded."""
    rows = [
        field[:, measured.channel(name)] if name in measured.channels else np.zeros_like(field[:, 0])
        for name in READINGS
    ]
    return np.stack(rows, axis=1)


def _pooled(each: list[Gap]) -> Gap:
    def rms(values: list[float]) -> float:
        # No channel has a gap where the model's motion was found in no dwell.
        return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")

    return Gap(
        rms([gap.relative for gap in each]),
        rms([gap.floor for gap in each]),
        rms([gap.sigma for gap in each]),
    )
