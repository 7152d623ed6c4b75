"""Least squares of periodic signals on their actual time stamps.

The signals y_c(t_j) of one clock are written as

    y_c(t) = sum_{k=-K..K} c_k exp(i k w t) + b t + noise,    c_{-k} = conj(c_k),  X_k = 2 c_k,  X_0 = c_0.

The normal matrix of the exponentials has the entries sum_j exp(i (l - k) w t_j): it depends on l - k only,
so 2K + 1 sums over the stamps give all of it, and it is close to (number of samples) times the identity
whatever the jitter, so its Cholesky factor is accurate. The slope b takes up slow drift; it is one further
row and column. Nothing asks for equal spacing or for a whole number of periods.

    >>> time = np.arange(1000) / 250.0
    >>> fit = fit_periodic(time - 2.0, np.cos(2 * np.pi * 2.0 * time)[None], 2.0, highest=3, gains_to=1)
    >>> np.round(np.abs(fit.amplitude[0]), 9).tolist()
    [0.0, 1.0, 0.0, 0.0]
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

_BLOCK = 2048
"""Samples handled at a time: keeps the table of exponentials in the cache and memory bounded."""


@dataclass(frozen=True)
class PeriodicFit:
    """Least-squares harmonics of C signals on one clock, with what is left.

    Attributes:
        amplitude: X_0..X_K [unit], (C, K + 1), at the time origin of the stamps given.
        slope: drift [unit/s], (C,).
        residual: signal less fit [unit], (C, N).
        gain: E|dX_k|^2 for noise of unit variance per sample, orders 0..m, (m + 1,).
        pseudo_gain: E(dX_k^2) for the same noise, complex, (m + 1,): zero when Re and Im are alike.
    """

    amplitude: NDArray[np.complex128]
    slope: NDArray[np.float64]
    residual: NDArray[np.float64]
    gain: NDArray[np.float64]
    pseudo_gain: NDArray[np.complex128]


def blocks(samples: int) -> Iterator[slice]:
    """Consecutive slices of at most a few thousand samples that cover ``range(samples)``."""
    return (slice(start, min(start + _BLOCK, samples)) for start in range(0, samples, _BLOCK))


def rotor_powers(time: NDArray[np.float64], frequency: float, highest: int) -> NDArray[np.complex128]:
    """exp(-2 pi i k f t) for k = 0..``highest``, (highest + 1, n), by repeated doubling of the power."""
    turns = np.empty((highest + 1, time.size), dtype=np.complex128)
    turns[0] = 1.0
    if highest == 0:
        return turns
    step = np.exp(-2j * np.pi * frequency * time)
    turns[1] = step
    known = 2
    while known <= highest:
        more = min(known, highest + 1 - known)
        np.multiply(turns[:more], turns[known - 1] * step, out=turns[known : known + more])
        known += more
    return turns


def fit_periodic(
    time: NDArray[np.float64], values: NDArray[np.float64], frequency: float, highest: int, gains_to: int
) -> PeriodicFit:
    """Harmonics 0..``highest`` of ``values`` (C, N) at ``frequency`` [Hz], sampled at ``time`` [s], (N,).

    Noise gains are given for the orders 0..``gains_to``. The stamps should be counted from near the middle
    of the record, which keeps harmonics and drift apart. Raises :class:`numpy.linalg.LinAlgError` when the
    stamps do not determine the harmonics.
    """
    reach = float(np.max(np.abs(time))) or 1.0
    ramp = time / reach
    lags, on_data, on_ramp = _sums(time, np.vstack([values, ramp]), frequency, highest)
    normal = np.empty((2 * highest + 2, 2 * highest + 2), dtype=np.complex128)
    # Row k, column l of E^H E is sum_j exp(i (l - k) w t_j); lags hold sum_j exp(-i m w t_j).
    normal[:-1, :-1] = scipy.linalg.toeplitz(lags, lags.conj())
    normal[:-1, -1] = on_ramp
    normal[-1, :-1] = on_ramp.conj()
    normal[-1, -1] = ramp @ ramp
    factor = scipy.linalg.cho_factor(normal, lower=True)
    right = np.vstack([on_data, (values @ ramp)[None]])
    solution = scipy.linalg.cho_solve(factor, right)
    two_sided = solution[highest : 2 * highest + 1].T
    amplitude = 2.0 * two_sided
    amplitude[:, 0] = two_sided[:, 0].real
    slope = solution[-1].real / reach
    gain, pseudo_gain = _gains(factor, highest, gains_to)
    residual = values - evaluate(time, amplitude, frequency) - slope[:, None] * time
    return PeriodicFit(amplitude, slope, residual, gain, pseudo_gain)


def evaluate(
    time: NDArray[np.float64], amplitude: NDArray[np.complex128], frequency: float
) -> NDArray[np.float64]:
    """The periodic signals X_0 + Re sum X_k exp(2 pi i k f t), (C, N), of ``amplitude`` (C, K + 1)."""
    signal = np.empty((amplitude.shape[0], time.size))
    for part in blocks(time.size):
        turns = rotor_powers(time[part], frequency, amplitude.shape[1] - 1)
        signal[:, part] = (amplitude.conj() @ turns).real
    return signal


def _sums(
    time: NDArray[np.float64], rows: NDArray[np.float64], frequency: float, highest: int
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    """Sums of the exponentials: lags 0..2K alone, and orders -K..K against the data and the ramp."""
    lags = np.zeros(2 * highest + 1, dtype=np.complex128)
    against = np.zeros((highest + 1, rows.shape[0]), dtype=np.complex128)
    for part in blocks(time.size):
        turns = rotor_powers(time[part], frequency, highest)
        lags[: highest + 1] += turns.sum(axis=1)
        lags[highest + 1 :] += turns[1:] @ turns[highest]
        against += turns @ rows[:, part].T
    both = np.vstack([against[:0:-1].conj(), against])
    return lags, both[:, :-1], both[:, -1]


def _gains(
    factor: tuple[NDArray[np.complex128], bool], highest: int, last: int
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Noise gains of X_0..X_last from the inverse normal matrix: its entries (k, k) and (k, -k)."""
    order = np.arange(last + 1)
    units = np.zeros((factor[0].shape[0], last + 1), dtype=np.complex128)
    units[highest + order, order] = 1.0
    columns = scipy.linalg.cho_solve(factor, units)
    gain = 4.0 * columns[highest + order, order].real
    pseudo_gain = 4.0 * columns[highest - order, order].conj()
    gain[0] /= 4.0
    pseudo_gain[0] = gain[0]
    return gain, pseudo_gain
