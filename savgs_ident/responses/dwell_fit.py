"""One dwell: frequency, harmonics and noise of every channel.

The fit starts at the road's own frequency; every channel then estimates the drift of its phase against it, and the
estimates are pooled by their variances. A channel is fitted with all orders that its sampling carries, not only
those asked for: truncated orders would otherwise bias the orders kept, or be counted as noise.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.responses.fundamental import (
    ClockGroup,
    frequency_step,
    highest_fitted_order,
    highest_valid_order,
    refine_frequency,
    shared_line,
    step_variance,
)
from savgs_ident.responses.noise_spectrum import estimate_noise_density
from savgs_ident.responses.periodic_fit import fit_periodic, plan_basis

_MOST_REFITS = 4
_MANY_VALUES = 0.5
_ARITHMETIC = 1e-12
_FLATTEST, _STEEPEST = 2.0, 8.0
_ENOUGH_FOR_SLOPE = 5


@dataclass(frozen=True)
class ChannelFit:
    """Harmonics 0..m of one channel, arrays (m + 1,), m the highest valid order; times counted from mid-record.

    ``density`` [unit^2] and ``dof`` describe the noise; ``variance`` and ``pseudo_variance`` are E|dX|^2 and
    E(dX^2), ``folded`` the part of the former that comes from orders folded by the sampling; ``drift_hz`` is
    how far this channel's own fundamental lies above the dwell's, ``drift_variance`` its variance [Hz^2].
    """

    amplitude: NDArray[np.complex128]
    density: NDArray[np.float64]
    dof: NDArray[np.float64]
    variance: NDArray[np.float64]
    folded: NDArray[np.float64]
    pseudo_variance: NDArray[np.complex128]
    noise_sd: float
    drift_hz: float
    drift_variance: float


@dataclass(frozen=True)
class DwellFit:
    """Fundamental [Hz], its standard deviation, whole periods recorded, and the channels by name."""

    frequency: float
    frequency_sd: float
    periods: int
    channels: Mapping[str, ChannelFit]


def fit_dwell(groups: tuple[ClockGroup, ...], road: str, start: float, orders: int) -> DwellFit:
    """Fit all channels of a dwell whose frequency is near ``start`` [Hz], up to ``orders``.

    Raises :class:`numpy.linalg.LinAlgError` when the stamps do not determine the harmonics.
    """
    lead = next(group for group in groups if road in group.names)
    frequency = refine_frequency(lead, lead.names.index(road), start)
    for _ in range(_MOST_REFITS):
        channels = {
            name: fit for group in groups for name, fit in _fit_group(group, frequency, orders).items()
        }
        shift, variance = _pool(channels)
        frequency += shift
        if _has_converged(abs(shift), variance, frequency, orders * lead.span_s):
            break
    periods = min(int(group.span_s * frequency + 0.02) for group in groups)
    return DwellFit(frequency, float(np.sqrt(variance)), periods, channels)


def _has_converged(shift: float, variance: float, frequency: float, order_seconds: float) -> bool:
    """Whether a step is too small to change the harmonics, which depend on it to second order only.

    ``order_seconds`` is highest order times duration [s]: the phase at the ends of the record moves by
    pi * shift * order_seconds, and an amplitude by a sixth of its square.
    """
    return shift <= 1e-13 * frequency or (shift <= np.sqrt(variance) and np.pi * shift * order_seconds < 3e-3)


def _pool(channels: Mapping[str, ChannelFit]) -> tuple[float, float]:
    """Common frequency correction [Hz] and its variance, weighted by information."""
    drift = np.array([fit.drift_hz for fit in channels.values()])
    variance = np.array([fit.drift_variance for fit in channels.values()])
    information = 1.0 / variance
    total = float(np.sum(information))
    return float(information @ drift) / total, 1.0 / total


def _fit_group(group: ClockGroup, frequency: float, orders: int) -> dict[str, ChannelFit]:
    last = highest_valid_order(group, frequency, orders)
    if last < 1:
        return {}
    highest = highest_fitted_order(group, frequency)
    basis = plan_basis(group.time, frequency, highest)
    fit = fit_periodic(basis, group.values, highest, last)
    noise = estimate_noise_density(group.time, fit.residual, frequency, highest, last)
    floor = _smallest_density(group.values)[:, None]
    density = np.maximum(noise.density, floor)
    folded = _folded_power(fit.amplitude, density, fit.gain, shared_line(group, frequency), last)
    kept = fit.amplitude[:, : last + 1]
    step, weight = frequency_step(basis, kept, fit.residual)
    variance = step_variance(kept, density, weight)
    spare = group.time.size - 2 * highest - 2
    noise_sd = np.sqrt(np.maximum(np.sum(fit.residual**2, axis=1) / spare, floor[:, 0]))
    return {
        name: ChannelFit(
            kept[i],
            density[i],
            noise.dof[i],
            density[i] * fit.gain + folded[i],
            folded[i],
            density[i] * fit.pseudo_gain,
            float(noise_sd[i]),
            float(step[i]),
            float(variance[i]),
        )
        for i, name in enumerate(group.names)
    }


def _folded_power(
    amplitude: NDArray[np.complex128],
    density: NDArray[np.float64],
    gain: NDArray[np.float64],
    line: int,
    last: int,
) -> NDArray[np.float64]:
    """Power E|X_l|^2 of the orders l = line -+ k that share a line with order k, (C, last + 1).

    Orders that share a line cannot be separated. The power of the uppermost quarter of the orders fitted, less their
    noise, is continued with the power law by which it has fallen from the quarter below (no flatter than the
    1/l^2 of a waveform with steps): a bias that cannot be known, expressed as a variance.
    """
    highest = amplitude.shape[1] - 1
    power = np.abs(amplitude) ** 2 - density[:, -1:] * gain[-1]
    quarter = max(highest // 4, 1)
    upper = np.maximum(np.mean(power[:, -quarter:], axis=1), 0.0)
    lower = np.maximum(np.mean(power[:, -2 * quarter : -quarter], axis=1), upper)
    fall = np.log(lower / np.where(upper > 0.0, upper, 1.0), where=upper > 0.0, out=np.zeros_like(upper))
    steepest = _STEEPEST if quarter >= _ENOUGH_FOR_SLOPE else _FLATTEST
    exponent = np.clip(fall / np.log(7.0 / 5.0), _FLATTEST, steepest)[:, None]
    middle = highest - 0.5 * quarter
    order = np.arange(last + 1)
    shares = (middle / (line - order)) ** exponent + (middle / (line + order)) ** exponent
    folded: NDArray[np.float64] = upper[:, None] * shares
    return folded


def _smallest_density(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance that rounding alone leaves, (C,): of the sensor's quantisation where visible, else of the arithmetic.

    Rounding error repeats with the signal where the period is a whole number of samples, so the
    estimate of the noise would miss it.
    """
    step = np.array([_quantisation_step(row) for row in values])
    arithmetic = _ARITHMETIC * np.max(np.abs(values), axis=1)
    smallest: NDArray[np.float64] = np.maximum(step / np.sqrt(12.0), np.maximum(arithmetic, 1e-150))
    return smallest**2


def _quantisation_step(row: NDArray[np.float64]) -> float:
    """The quantisation step of the sensor where values recur often enough to show one; 0 otherwise."""
    distinct = np.unique(row)
    if not 1 < distinct.size < _MANY_VALUES * row.size:
        return 0.0
    return float(np.quantile(np.diff(distinct), 0.1))
