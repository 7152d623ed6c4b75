"""The fundamental frequency of a dwell, by nonlinear least squares with its own harmonics.

With the harmonics X_k fitted at a trial frequency f, the residual r changes with f along

    d(t) = Re sum_k 2 pi i k t X_k exp(2 pi i k f t).

The part of d that no harmonic can imitate, d', gives the Gauss-Newton step <d', r> / <d', d'> and, with the
noise density S_k near order k, its variance sum_k w_k S_k / <d', d'>, w_k the share of order k in d.
"""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.responses.clocks import ClockGroup, highest_fitted_order
from savgs_ident.responses.nonuniform_fft import signals
from savgs_ident.responses.periodic_fit import PeriodicBasis, fit_periodic, plan_basis

_ROAD_ORDERS = 5
_ROUNDS = 12
_PADDING = 8
_SETTLED = 1e-8


def coarse_frequency(time: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Frequency [Hz] of the strongest line of one signal (N,), to about a tenth of 1 / duration."""
    even = np.linspace(time[0], time[-1], time.size)
    signal = np.interp(even, time, values)
    windowed = (signal - np.mean(signal)) * np.hanning(signal.size)
    length = _PADDING * signal.size
    strength = np.abs(np.fft.rfft(windowed, length))
    return float((np.argmax(strength[1:]) + 1) / (length * (even[1] - even[0])))


def refine_frequency(group: ClockGroup, channel: int, start: float) -> float:
    """Least-squares fundamental [Hz] of one channel of ``group``, from ``start``.

    Stays at the last trial when the steps lead away from ``start`` by more than a cycle over the record.
    """
    frequency = start
    values = group.values[channel : channel + 1]
    for _ in range(_ROUNDS):
        highest = min(_ROAD_ORDERS, highest_fitted_order(group, frequency))
        if highest < 1:
            return frequency
        basis = plan_basis(group.time, frequency, highest)
        fit = fit_periodic(basis, values, highest, 0)
        step, _weight = frequency_step(basis, fit.amplitude, fit.residual)
        if abs(frequency + float(step[0]) - start) * group.span_s > 1.0:
            return frequency
        frequency += float(step[0])
        if abs(float(step[0])) < _SETTLED * frequency:
            break
    return frequency


def frequency_step(
    basis: PeriodicBasis, amplitude: NDArray[np.complex128], residual: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss-Newton step [Hz] of each channel and <d', d'> [unit^2/Hz^2], both (C,).

    ``amplitude`` (C, m + 1) are the harmonics, ``residual`` (C, N) what they (or more of them) left.
    """
    order = np.arange(amplitude.shape[1])
    along = basis.time * signals(basis.plan, 2j * np.pi * order * amplitude)
    own = fit_periodic(basis, along, amplitude.shape[1] - 1, 0).residual
    weight = np.sum(own**2, axis=1)
    safe = np.where(weight > 0.0, weight, 1.0)
    return np.where(weight > 0.0, np.sum(own * residual, axis=1) / safe, 0.0), weight


def step_variance(
    amplitude: NDArray[np.complex128], density: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Variance [Hz^2] of each channel's step, (C,), infinite for a channel that tells nothing.

    ``amplitude`` and the noise ``density`` [unit^2] have shape (C, m + 1), ``weight`` is <d', d'>.
    """
    share = (np.arange(amplitude.shape[1]) * np.abs(amplitude)) ** 2
    total = np.sum(share, axis=1)
    tells = (total > 0.0) & (weight > 0.0)
    mean_density = np.sum(share * density, axis=1) / np.where(tells, total, 1.0)
    return np.where(tells, mean_density / np.where(tells, weight, 1.0), np.inf)
