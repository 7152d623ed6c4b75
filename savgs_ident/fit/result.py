"""What a fit gives: estimates with their covariance, what the data identify, and what the model leaves unexplained.

An entry x = (Re, Im) of a measured harmonic with covariance C is whitened by the Cholesky factor L of C:
L^-1 (x - predicted) is, for a true model, two independent unit normals. The gap of a channel over a set of
entries is their relative rms, sqrt(sum |r|^2 / sum |x|^2), and the rms of the whitened residuals; channels
are pooled with equal weight, each relative to its own signal. For Bode plots the first harmonics are divided by
that of the input, their standard deviations propagated to magnitude and phase.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.fit.identified import Identified
from savgs_ident.inference.likely_mistake import likely_mistake
from savgs_ident.responses.harmonic_response import HarmonicResponse, peak_to_peak
from savgs_ident.responses.programmes import driven_alike, settings_of


@dataclass(frozen=True)
class Fit(Identified):
    """A finished fit of harmonics; arrays are read-only.

    Attributes:
        prior_chi2: squared deviations of all parameters from what was known before, in its standard deviations.
        dwell_status: whether the model's periodic solution converged, per dwell.
        measured: the response that was fitted.
        orders: highest harmonic order used.
        used: which entries of ``predicted`` were fitted, (D, C, orders + 1).
        predicted: identified model, complex [unit of the reading], (D, C, orders + 1), in the plant's channels.
        frictionless: the plant without effects at the same estimates [unit of the reading], (D, C, orders + 1).
        frictionless_status: whether the periodic solution of that converged, per dwell; it is NaN where not.
        as_given: the model before fitting [unit of the reading], (D, C, orders + 1).
        starts: (chi2 reached, status) of each start of the optimisation.
        quantity: "harmonics" or "peak_to_peak", what was fitted.
    """

    presenter: ClassVar[str] = "FIT"

    prior_chi2: float
    dwell_status: tuple[Status, ...]
    measured: HarmonicResponse
    orders: int
    used: NDArray[np.bool_]
    predicted: NDArray[np.complex128]
    frictionless: NDArray[np.complex128]
    frictionless_status: tuple[Status, ...]
    as_given: NDArray[np.complex128]
    starts: tuple[tuple[float, Status], ...]
    quantity: str

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels of the plant."""
        return tuple(each.name for each in self.estimated.channels)

    @property
    def unsolved(self) -> str:
        """Whether periodic motions are lacking, in words."""
        found = all(each.ok for each in self.dwell_status)
        return "" if found else "the model's periodic motion was not found in every dwell"

    @property
    def mistaken(self) -> str:
        """A channel with another unit or sign than its header's, or two that were exchanged, in words."""
        kept = self.as_given.shape[2]
        measured = _readings_of(self.measured, self.channels, self.measured.harmonics)[..., :kept]
        return likely_mistake(measured, self.as_given, self.used, self.estimated.plant)

    @property
    def compared(self) -> Mapping[str, object]:
        """Quantity and highest order."""
        return {"quantity": self.quantity, "orders": self.orders}


@dataclass(frozen=True)
class Gap:
    """Relative rms residual [1], what the noise alone leaves of it [1], and the rms in noise sd [1]."""

    relative: float
    floor: float
    sigma: float


def whitened(
    measured: HarmonicResponse,
    channels: Sequence[str],
    predicted: NDArray[np.complex128],
    used: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Residuals of (Re, Im) in noise standard deviations, (D, C, K, 2); NaN where an entry is not used.

    ``predicted`` and ``used`` are (D, C, K) for the named ``channels``, orders 0..K-1.
    """
    orders = predicted.shape[2]
    residual = _readings_of(measured, channels, measured.harmonics)[..., :orders] - predicted
    covariance = _readings_of(measured, channels, measured.covariance)[:, :, :orders]
    parts = np.stack([residual.real, residual.imag], axis=-1)
    out = np.full(parts.shape, np.nan)
    factor = np.linalg.cholesky(covariance[used])
    out[used] = np.linalg.solve(factor, parts[used][..., None])[..., 0]
    return out


def comparable(measured: HarmonicResponse, channels: Sequence[str], orders: int) -> NDArray[np.bool_]:
    """The entries of the named channels that a model can be held against, (D, C, orders + 1).

    Those with noise known, means left out.
    """
    kept = slice(0, orders + 1)
    noise = np.linalg.det(_readings_of(measured, channels, measured.covariance)[:, :, kept])
    used = _readings_of(measured, channels, measured.valid)[:, :, kept] & np.isfinite(noise) & (noise > 0.0)
    used[..., 0] = False
    return np.asarray(used)


def gaps(
    measured: HarmonicResponse,
    channels: Sequence[str],
    predicted: NDArray[np.complex128],
    used: NDArray[np.bool_],
) -> dict[str, Gap]:
    """The gap between the measured response and a prediction, by channel and "together".

    Prediction [unit of the reading] and ``used`` are (D, C, K).
    """
    orders = predicted.shape[2]
    sigma = whitened(measured, channels, predicted, used)
    harmonics = _readings_of(measured, channels, measured.harmonics)[..., :orders]
    spread = np.trace(
        _readings_of(measured, channels, measured.covariance)[:, :, :orders], axis1=-2, axis2=-1
    )
    found = {}
    for c, name in enumerate(channels):
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
    return np.asarray(
        np.nansum(whitened(fit.measured, fit.channels, fit.predicted, fit.used) ** 2, axis=(1, 2, 3))
    )


def entries_by_dwell(fit: Fit) -> NDArray[np.int64]:
    """How many real data entries of each dwell were fitted, (D,)."""
    if fit.quantity == "peak_to_peak":
        return np.asarray(np.sum(np.any(fit.used, axis=2), axis=1))
    return np.asarray(2 * np.sum(fit.used, axis=(1, 2)))


def predicted_peak_to_peak(
    measured: HarmonicResponse, channels: Sequence[str], predicted: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Peak to peak of a prediction [unit of the channel], (D, C), with the orders that were measured."""
    valid = _readings_of(measured, channels, measured.valid)[..., : predicted.shape[2]]
    return peak_to_peak(predicted, valid)


def peak_to_peak_sigma(fit: Fit) -> NDArray[np.float64]:
    """Peak-to-peak residuals in their standard deviations, (D, C); NaN where a channel is not used."""
    measured = _readings_of(fit.measured, fit.channels, fit.measured.peak_to_peak)
    deviation = _readings_of(fit.measured, fit.channels, fit.measured.peak_to_peak_sd)
    used = np.any(fit.used, axis=2)
    out = np.full(used.shape, np.nan)
    residual = measured - predicted_peak_to_peak(fit.measured, fit.channels, fit.predicted)
    out[used] = residual[used] / deviation[used]
    return out


def _readings_of(measured: HarmonicResponse, channels: Sequence[str], field: NDArray[Any]) -> NDArray[Any]:
    """The rows of ``channels`` out of a field (D, C, ...); zeros for a channel that was not recorded."""
    rows = [
        field[:, measured.channel(name)] if name in measured.channels else np.zeros_like(field[:, 0])
        for name in channels
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


@dataclass(frozen=True)
class OverWindows:
    """What is compared in one channel of D windows, summed over them at each of the n frequencies where any is.

    Attributes:
        frequency: [Hz], (n,).
        known: their places among the K numbers of a reading, (n,).
        used: which numbers are compared, (D, K).
    """

    frequency: NDArray[np.float64]
    known: NDArray[np.int64]
    used: NDArray[np.bool_]

    @classmethod
    def of(cls, measured: HarmonicResponse, used: NDArray[np.bool_]) -> "OverWindows":
        """Of the numbers that are ``used`` (D, K)."""
        known = np.flatnonzero(used.any(axis=0))
        return cls(np.asarray(measured.spacing[0] * known, np.float64), known, used)

    def rms(self, squares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Root mean square over the windows of what ``squares`` (..., D, K) are the squares of, (..., n)."""
        total = np.sum(np.where(self.used, squares, 0.0), axis=-2)[..., self.known]
        return np.asarray(np.sqrt(total / np.sum(self.used, axis=0)[self.known]))


def recorded_spectra(
    measured: HarmonicResponse, name: str, orders: int
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """What a channel reads, and its variance, in the first numbers up to ``orders``, (D, orders) each."""
    place = measured.channel(name)
    spread = np.trace(measured.covariance[:, place, :orders], axis1=-2, axis2=-1)
    return measured.harmonics[:, place, :orders], spread


@dataclass(frozen=True)
class MeasuredPoints:
    """Measured responses of D dwells with standard deviations, in C channels.

    Attributes:
        frequency: [Hz], (D,), increasing.
        transfer: complex first harmonic per unit of the input, (D, C); NaN where not measured.
        magnitude_sd: of its magnitude, (D, C).
        phase_sd: of its phase [rad], (D, C).
        peak_to_peak: [unit], (D, C).
        peak_to_peak_sd: [unit], (D, C).
        programme: number of the line that each dwell is on, (D,).
    """

    frequency: NDArray[np.float64]
    transfer: NDArray[np.complex128]
    magnitude_sd: NDArray[np.float64]
    phase_sd: NDArray[np.float64]
    peak_to_peak: NDArray[np.float64]
    peak_to_peak_sd: NDArray[np.float64]
    programme: NDArray[np.intp]


def measured_points(response: HarmonicResponse, channels: Sequence[str], driven_by: str) -> MeasuredPoints:
    """The measured response of the named channels to the input ``driven_by``, as points with error bars."""
    shape = (len(response.tests), len(channels))
    transfer = np.full(shape, np.nan, dtype=np.complex128)
    magnitude_sd, phase_sd, span, span_sd = (np.full(shape, np.nan) for _ in range(4))
    drive = response.harmonics[:, response.channel(driven_by), 1]
    for column, name in enumerate(channels):
        if name not in response.channels:
            continue
        c = response.channel(name)
        d = response.valid[:, c, 1]
        first, covariance = response.harmonics[d, c, 1], response.covariance[d, c, 1]
        along = first / np.abs(first)
        transfer[d, column] = first / drive[d]
        magnitude_sd[d, column] = _deviation(covariance, along) / np.abs(drive[d])
        phase_sd[d, column] = _deviation(covariance, 1j * along) / np.abs(first)
        span[d, column], span_sd[d, column] = response.peak_to_peak[d, c], response.peak_to_peak_sd[d, c]
    others = [name for name in response.channels if name not in (driven_by, *channels)]
    levels = [response.harmonics[:, response.channel(name), 0] for name in others]
    lines = driven_alike(response.frequency, settings_of(drive, levels))
    return MeasuredPoints(response.frequency, transfer, magnitude_sd, phase_sd, span, span_sd, lines)


def _deviation(covariance: NDArray[np.float64], direction: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Standard deviation of phasors (n, 2, 2) along unit phasors (n,)."""
    unit = np.stack([direction.real, direction.imag], axis=-1)
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", unit, covariance, unit)))
