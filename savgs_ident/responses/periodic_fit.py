"""Least squares of periodic signals on their actual time stamps.

The signals y_c(t_j) of one clock are written as

    y_c(t) = sum_{k=-K..K} c_k exp(i k w t) + b t + noise,    c_{-k} = conj(c_k),  X_k = 2 c_k,  X_0 = c_0.

The normal matrix of the exponentials has the entries sum_j exp(i (l - k) w t_j): it depends on l - k only (a
Toeplitz matrix), so 2K + 1 sums over the stamps give all of it, and it is close to N times the identity
whatever the jitter. Conjugate gradients, with products by fast Fourier transform, therefore solve it to
rounding in some ten steps; where they do not, the stamps do not determine the harmonics. The slope b takes up
slow drift. Nothing asks for equal spacing or for a whole number of periods.

    >>> time = np.arange(1000) / 250.0 - 2.0
    >>> basis = plan_basis(time, 2.0, highest=3)
    >>> fit = fit_periodic(basis, np.cos(4 * np.pi * time)[None], highest=3, gains_to=1)
    >>> np.round(np.abs(fit.amplitude[0]), 9).tolist()
    [0.0, 1.0, 0.0, 0.0]
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from savgs_ident.responses.nonuniform_fft import TransformPlan, plan_transform, signals, sums

_MOST_STEPS = 150
_PRECISION = 1e-13
_GAIN_PRECISION = 1e-8
_LOST = 1e6


@dataclass(frozen=True)
class PeriodicBasis:
    """Stamps ``time`` [s], (N,), the fundamental [Hz], and the plan of the sums over them."""

    time: NDArray[np.float64]
    frequency: float
    plan: TransformPlan


@dataclass(frozen=True)
class PeriodicFit:
    """Least-squares harmonics of C signals on one clock, with what is left.

    Attributes:
        amplitude: X_0..X_K [unit], (C, K + 1), at the time origin of the stamps given.
        slope: drift [unit/s], (C,).
        residual: signal less fit [unit], (C, N).
        gain: E|dX_k|^2 for noise of unit variance per sample [1], orders 0..m, (m + 1,).
        pseudo_gain: E(dX_k^2) for the same noise [1], complex, (m + 1,): zero when Re and Im are alike.
    """

    amplitude: NDArray[np.complex128]
    slope: NDArray[np.float64]
    residual: NDArray[np.float64]
    gain: NDArray[np.float64]
    pseudo_gain: NDArray[np.complex128]


def plan_basis(time: NDArray[np.float64], frequency: float, highest: int) -> PeriodicBasis:
    """The basis in which orders up to ``highest`` of ``frequency`` [Hz] can be fitted at ``time`` [s], (N,).

    Stamps should be counted from near the middle of the record, which keeps harmonics and drift apart.
    """
    return PeriodicBasis(time, frequency, plan_transform(2.0 * np.pi * frequency * time, 2 * highest))


def fit_periodic(
    basis: PeriodicBasis, values: NDArray[np.float64], highest: int, gains_to: int
) -> PeriodicFit:
    """Harmonics 0..``highest`` of ``values`` (C, N) [unit], no higher than ``basis`` was planned for.

    Noise gains are given for the orders 0..``gains_to``, to better than 1e-6 of themselves. Raises
    :class:`numpy.linalg.LinAlgError` when the stamps do not determine the harmonics.
    """
    time = basis.time
    reach = float(np.max(np.abs(time))) or 1.0
    ramp = time / reach
    found = sums(basis.plan, np.vstack([np.ones_like(ramp), ramp, values]))
    lags = found[0, : 2 * highest + 1]
    from_rows, units = _both_sides(found[1:, : highest + 1]), _units(highest, gains_to)
    right = np.vstack([from_rows, units])
    solved = np.vstack(
        [_solve_toeplitz(lags, from_rows, _PRECISION), _solve_toeplitz(lags, units, _GAIN_PRECISION)]
    )
    # Row 0 of both: the ramp. It is eliminated last, by its part that no harmonic can imitate.
    shared = np.sum(right * solved[0].conj(), axis=1)
    left_of_ramp = float(np.sum(ramp**2)) - shared[0].real
    from_data = np.sum(values * ramp, axis=1)
    last_rows = np.concatenate([from_data, np.zeros(gains_to + 1)])
    slope = (last_rows - shared[1:]) / left_of_ramp
    solution = solved[1:] - slope[:, None] * solved[0]
    channels = values.shape[0]
    amplitude = 2.0 * solution[:channels, highest:]
    amplitude[:, 0] = amplitude[:, 0].real / 2.0
    drift = slope[:channels].real / reach
    gain, pseudo_gain = _gains(solution[channels:], highest)
    residual = values - signals(basis.plan, amplitude) - drift[:, None] * time
    return PeriodicFit(amplitude, drift, residual, gain, pseudo_gain)


def _both_sides(positive: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Orders -K..K from orders 0..K of sums over real data."""
    return np.concatenate([positive[:, :0:-1].conj(), positive], axis=1)


def _units(highest: int, last: int) -> NDArray[np.complex128]:
    """Unit vectors for the orders 0..``last``, whose solutions are columns of the inverse."""
    return np.eye(last + 1, 2 * highest + 1, highest, dtype=np.complex128)


def _solve_toeplitz(
    lags: NDArray[np.complex128], right: NDArray[np.complex128], precision: float
) -> NDArray[np.complex128]:
    """Rows x of G x = b for the rows b of ``right`` (R, n); G_kl = conj(lags[l - k]), by conjugate gradients.

    Raises :class:`numpy.linalg.LinAlgError` if that does not converge.
    """
    count = right.shape[1]
    length = scipy.fft.next_fast_len(2 * count - 1)
    circulant = np.zeros(length, dtype=np.complex128)
    circulant[:count] = lags
    circulant[length - count + 1 :] = lags[:0:-1].conj()
    symbol = scipy.fft.fft(circulant)
    scale = lags[0].real
    solution: NDArray[np.complex128] = right / scale
    residual = right - _times(symbol, solution)
    direction = residual
    power = _squares(residual)
    start = _squares(right)
    goal = precision**2 * start
    for _ in range(_MOST_STEPS):
        if np.all(power <= goal):
            return solution
        if np.any(power > _LOST * start):
            break
        image = _times(symbol, direction)
        curvature = np.sum((direction.conj() * image).real, axis=1)
        stride = np.where(power > goal, power, 0.0) / np.where(curvature > 0.0, curvature, 1.0)
        solution = solution + stride[:, None] * direction
        residual = residual - stride[:, None] * image
        before, power = power, _squares(residual)
        direction = residual + (power / np.where(before > 0.0, before, 1.0))[:, None] * direction
    raise np.linalg.LinAlgError("the time stamps do not determine the harmonics")


def _times(symbol: NDArray[np.complex128], rows: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Toeplitz matrix times each row, through the circulant that contains it."""
    spectrum = scipy.fft.fft(rows, symbol.size) * symbol
    product: NDArray[np.complex128] = scipy.fft.ifft(spectrum)[:, : rows.shape[1]]
    return product


def _squares(rows: NDArray[np.complex128]) -> NDArray[np.float64]:
    total: NDArray[np.float64] = np.sum(rows.real**2 + rows.imag**2, axis=1)
    return total


def _gains(
    columns: NDArray[np.complex128], highest: int
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Noise gains of X_0..X_m from columns 0..m of the inverse normal matrix: entries (k, k) and (k, -k)."""
    order = np.arange(columns.shape[0])
    gain = 4.0 * columns[order, highest + order].real
    pseudo_gain = 4.0 * columns[order, highest - order].conj()
    gain[0] /= 4.0
    pseudo_gain[0] = gain[0]
    return gain, pseudo_gain
