"""Least squares of periodic signals on their actual time stamps.

The signals y_c(t_j) of one clock are written as

    y_c(t) = sum_{k=-K..K} c_k exp(i k w t) + b t + noise,    c_{-k} = conj(c_k),  X_k = 2 c_k,  X_0 = c_0.

    >>> time = np.arange(1000) / 250.0 - 2.0
    >>> basis = plan_basis(time, 2.0, highest=3)
    >>> fit = fit_periodic(basis, np.cos(4 * np.pi * time)[None], highest=3, gains_to=1)
    >>> np.round(np.abs(fit.amplitude[0]), 9).tolist()
    [0.0, 1.0, 0.0, 0.0]

The normal matrix of the exponentials has the entries sum_j exp(i (l - k) w t_j): it depends on l - k only (a
Toeplitz matrix), so 2K + 1 sums over the stamps determine it, and it is close to N times the identity whatever
the jitter. Conjugate gradients, with products by fast Fourier transform, therefore converge to rounding in about
ten steps. The slope b absorbs slow drift. Neither
equal spacing nor a whole number of periods is needed.

These sums of exponentials over unevenly spaced stamps are a nonuniform fast Fourier transform. Each sample is
spread over the nearest 14 points of a fine, even grid of phases by a smooth kernel; the grid is transformed; the
kernel's own transform is divided out. With the kernel exp(b (sqrt(1 - x^2) - 1)), a grid twice as fine as the
highest order needs and b = 2.3 * 14, the result is accurate to about 1e-12 of the largest sum. No threaded library
is called: short dwells stay fast on a busy machine.

    >>> plan = plan_transform(np.array([0.0, 0.1, 0.5]), 2)
    >>> np.round(sums(plan, np.array([[1.0, 1.0, 2.0]])), 4).tolist()
    [[(4+0j), (3.7502-1.0587j), (3.0607-1.8816j)]]

Source: A. H. Barnett, J. Magland, L. af Klinteberg, SIAM J. Sci. Comput. 41 (2019) C479.
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

_WIDTH = 14
_SHAPE = 2.30 * _WIDTH
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_KERNEL_AT_NODES = np.exp(_SHAPE * (np.sqrt(1.0 - _NODES**2) - 1.0))


@dataclass(frozen=True)
class TransformPlan:
    """Grid points and weights of each of N samples, for orders 0..``highest``.

    Attributes:
        place: grid points, (N, 14).
        weight: kernel values there [1], (N, 14).
        size: points of the grid.
        correction: 1 over the kernel's transform [1], (highest + 1,).
    """

    place: NDArray[np.int64]
    weight: NDArray[np.float64]
    size: int
    correction: NDArray[np.float64]


def plan_transform(phase: NDArray[np.float64], highest: int) -> TransformPlan:
    """The plan for samples at ``phase`` [rad], (N,), and orders up to ``highest``."""
    size = scipy.fft.next_fast_len(max(4 * highest + 2, 2 * _WIDTH), real=True)
    position = np.mod(phase / (2.0 * np.pi), 1.0) * size
    first = np.ceil(position - _WIDTH / 2).astype(np.int64)
    place = first[:, None] + np.arange(_WIDTH)
    distance = (place - position[:, None]) / (_WIDTH / 2)
    inside = np.sqrt(np.maximum(1.0 - distance**2, 0.0))
    weight = np.exp(_SHAPE * (inside - 1.0))
    angle = np.pi * _WIDTH / size * np.outer(np.arange(highest + 1), _NODES)
    transform = _WIDTH / 2 * np.sum(_WEIGHTS * _KERNEL_AT_NODES * np.cos(angle), axis=1)
    return TransformPlan(np.mod(place, size), weight, size, 1.0 / transform)


def sums(plan: TransformPlan, rows: NDArray[np.float64]) -> NDArray[np.complex128]:
    """sum_j y_j exp(-i k phase_j) for every row y of ``rows`` (C, N) and order k: (C, highest + 1).

    Rows of any unit, and sums in the same.
    """
    place = plan.place.ravel()
    grids = np.stack([np.bincount(place, (plan.weight * row[:, None]).ravel(), plan.size) for row in rows])
    result: NDArray[np.complex128] = scipy.fft.rfft(grids)[:, : plan.correction.size] * plan.correction
    return result


def signals(plan: TransformPlan, amplitude: NDArray[np.complex128]) -> NDArray[np.float64]:
    """X_0 + Re sum_k X_k exp(i k phase_j) for every row X of ``amplitude`` (C, m + 1), m <= highest.

    Amplitudes of any unit, and signals in the same.
    """
    spectrum = 0.5 * plan.size * amplitude * plan.correction[: amplitude.shape[1]]
    spectrum[:, 0] = 2.0 * spectrum[:, 0].real
    grids = scipy.fft.irfft(spectrum, plan.size)
    return np.stack([np.einsum("jw,jw->j", plan.weight, grid[plan.place]) for grid in grids])


_MOST_STEPS = 150
_PRECISION = 1e-13
_GAIN_PRECISION = 1e-8
_DIVERGED = 1e6
_SINGULAR = 1e-9


@dataclass(frozen=True)
class PeriodicBasis:
    """Stamps ``time`` [s], (N,), the fundamental [Hz], and the plan of the sums over them."""

    time: NDArray[np.float64]
    frequency: float
    plan: TransformPlan


@dataclass(frozen=True)
class PeriodicFit:
    """Least-squares harmonics of C signals on one clock, and the residual.

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
    from_rows, units = _both_sides(found[1:, : highest + 1]), _unit_vectors(highest, gains_to)
    right = np.vstack([from_rows, units])
    solved = np.vstack(
        [_solve_toeplitz(lags, from_rows, _PRECISION), _solve_toeplitz(lags, units, _GAIN_PRECISION)]
    )
    # Row 0 of both: the ramp. It is eliminated last, by its part orthogonal to the harmonics.
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


def fit_resolved(
    time: NDArray[np.float64], frequency: float, values: NDArray[np.float64], highest: int, gains_to: int
) -> tuple[PeriodicBasis, PeriodicFit, int]:
    """The same at ``time`` [s], up to ``highest``, halved as often as stamps that lack leave it unresolved.

    With the basis and the highest order fitted, which is ``gains_to`` at least. Raises
    :class:`numpy.linalg.LinAlgError` when the stamps do not determine even these.
    """
    while True:
        basis = plan_basis(time, frequency, highest)
        try:
            return basis, fit_periodic(basis, values, highest, gains_to), highest
        except np.linalg.LinAlgError:
            if highest <= gains_to:
                raise
            highest = max(highest // 2, gains_to)


def _both_sides(positive: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Orders -K..K from orders 0..K of sums over real data."""
    return np.concatenate([positive[:, :0:-1].conj(), positive], axis=1)


def _unit_vectors(highest: int, last: int) -> NDArray[np.complex128]:
    """Unit vectors for the orders 0..``last``, whose solutions are columns of the inverse."""
    return np.eye(last + 1, 2 * highest + 1, highest, dtype=np.complex128)


def _solve_toeplitz(
    lags: NDArray[np.complex128], right: NDArray[np.complex128], precision: float
) -> NDArray[np.complex128]:
    """Rows x of G x = b for the rows b of ``right`` (R, n); G_kl = conj(lags[l - k]), by conjugate gradients.

    By elimination where these are slow, as with stamps that jitter. Raises :class:`numpy.linalg.LinAlgError` if G is
    singular.
    """
    count = right.shape[1]
    length = scipy.fft.next_fast_len(2 * count - 1)
    circulant = np.zeros(length, dtype=np.complex128)
    circulant[:count] = lags
    circulant[length - count + 1 :] = lags[:0:-1].conj()
    symbol = scipy.fft.fft(circulant)
    scale = lags[0].real
    solution: NDArray[np.complex128] = right / scale
    residual = right - _toeplitz_product(symbol, solution)
    direction = residual
    power = _squared_norms(residual)
    start = _squared_norms(right)
    goal = precision**2 * start
    for _ in range(_MOST_STEPS):
        if np.all(power <= goal):
            return solution
        if np.any(power > _DIVERGED * start):
            break
        image = _toeplitz_product(symbol, direction)
        curvature = np.sum((direction.conj() * image).real, axis=1)
        stride = np.where(power > goal, power, 0.0) / np.where(curvature > 0.0, curvature, 1.0)
        solution = solution + stride[:, None] * direction
        residual = residual - stride[:, None] * image
        before, power = power, _squared_norms(residual)
        direction = residual + (power / np.where(before > 0.0, before, 1.0))[:, None] * direction
    return _eliminated(lags, right)


def _eliminated(lags: NDArray[np.complex128], right: NDArray[np.complex128]) -> NDArray[np.complex128]:
    order = np.arange(right.shape[1])
    both_sides = np.concatenate([lags[:0:-1], lags.conj()])
    gram = both_sides[order - order[:, None] + lags.size - 1]
    sizes = np.linalg.eigvalsh(gram)
    if not sizes[0] > _SINGULAR * sizes[-1]:
        raise np.linalg.LinAlgError("the time stamps do not determine the harmonics")
    return np.asarray(np.linalg.solve(gram, right.T).T)


def _toeplitz_product(symbol: NDArray[np.complex128], rows: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Toeplitz matrix times each row, through the circulant that contains it."""
    spectrum = scipy.fft.fft(rows, symbol.size) * symbol
    product: NDArray[np.complex128] = scipy.fft.ifft(spectrum)[:, : rows.shape[1]]
    return product


def _squared_norms(rows: NDArray[np.complex128]) -> NDArray[np.float64]:
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
