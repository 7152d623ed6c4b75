"""One dwell: frequency, harmonics and noise of every channel.

The fit starts at the frequency of the driven input; every channel then estimates the drift of its phase against it,
and the estimates are pooled by their variances. A channel is fitted with all orders that its sampling carries, not
only those asked for: truncated orders would otherwise bias the orders kept, or be counted as noise.

The noise is what does not repeat from period to period. A periodic signal has power at the multiples of its
fundamental f and nowhere else; a record of P periods also resolves the P - 1 frequencies between two neighbouring
harmonics, and power found there is noise. The power at those frequencies, I(v) = |sum_j r_j exp(-2 pi i v t_j)|^2 /
N, is exponentially distributed about the noise density S(v) (variance per sample if the noise were white). Its
logarithm is fitted by an even polynomial in asinh(2 v / f) by maximum likelihood (Whittle), the degree chosen by an
information criterion (3.5 for a coefficient): white noise takes one coefficient and hundreds of degrees of freedom,
coloured noise as many as it needs. A peak too narrow for the polynomial is found by its excess over the
neighbouring frequencies. Noise that still rises towards zero below a few cycles per record (slow drift beyond a
straight line) is understated at order 0, and only there: its level there is not in the record.

References: P. Whittle, Ark. Mat. 2 (1953) 423; R. Pintelon, J. Schoukens, System Identification: A
Frequency Domain Approach (2012), chapter 2 (noise from non-excited frequencies).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.special
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
from savgs_ident.responses.periodic_fit import fit_resolved, plan_transform, sums

_HIGHEST_DEGREE = 6
_NEIGHBOURS = 24
_PEAK_SIGNIFICANCE = 1e-4
_MOST_STEPS = 60
_ORDERS_BEYOND = 2.0
_PENALTY = 3.5
_CONVERGED = 1e-4
_FEWEST_LINES = 100
_MOST_ABSORBED = 0.5
_BAND = 0.45
_TOUCHING = 1e-6


@dataclass(frozen=True)
class NoiseDensity:
    """Noise density at the orders 0..n of C channels.

    Attributes:
        density: variance that one sample would have, were the noise white at this level [unit^2], (C, n + 1).
        dof: degrees of freedom of each density: its relative variance is 2 / dof, (C, n + 1).
    """

    density: NDArray[np.float64]
    dof: NDArray[np.float64]


def estimate_noise_density(
    time: NDArray[np.float64],
    residual: NDArray[np.float64],
    frequency: float,
    highest: int,
    orders: int,
    left_out: int = 0,
) -> NoiseDensity:
    """Noise density at orders 0..``orders`` of ``residual`` (C, N), left by a fit of orders 0..``highest``.

    ``time`` [s] of shape (N,), ``frequency`` [Hz] the fundamental; ``left_out`` samples of the record are not among
    them. Beyond the last frequency that the data resolve, the density is that of the last one.
    """
    count = time.size + left_out
    span = float(time[-1] - time[0]) * count / (count - 1)
    lines, kept = _lines_between(span * frequency, count, highest, orders)
    power = _line_power(time, residual, span, int(lines[-1]))[:, lines] / kept
    level = np.maximum(np.mean(power, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    wanted = np.minimum(np.arange(orders + 1) * span * frequency, lines[-1])
    place = np.arcsinh(2.0 * np.concatenate([lines, wanted]) / (span * frequency))
    at_lines, at_orders, dof = _fit_density(place, lines.size, power / level)
    excess, excess_dof = _excess(power / level / at_lines, lines, wanted)
    return NoiseDensity(level * at_orders * excess, np.where(excess > 1.0, excess_dof, dof))


def _lines_between(
    periods: float, samples: int, highest: int, orders: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Frequencies, in cycles per record, away from harmonics; and the share of the noise that the fit leaves there.

    A harmonic fit absorbs sinc^2(d) of the noise power at a distance of d cycles per record; the regressor of the
    drift, periodically a sawtooth, absorbs 3 / (pi j)^2 at j cycles per record. Orders above the Nyquist frequency
    absorb power where they fold to: frequencies repeat after as many cycles as there are samples.
    """
    band = min(highest + 0.5, _BAND * samples / periods)
    top = min(band, max(_ORDERS_BEYOND * orders, _FEWEST_LINES / periods))
    lines = np.arange(1, max(int(top * periods), 2) + 1)
    apart = lines[:, None] - np.arange(-highest, highest + 1) * periods
    apart -= samples * np.round(apart / samples)
    # Lines are whole numbers, so the sine of pi * apart depends on the order alone.
    sine = np.sin(np.pi * periods * np.arange(-highest, highest + 1))
    touching = np.abs(apart) < _TOUCHING
    absorbed = np.sum(np.where(touching, 1.0, (sine / (np.pi * np.where(touching, 1.0, apart))) ** 2), axis=1)
    free = absorbed < _MOST_ABSORBED
    kept = 1.0 - absorbed - 3.0 / (np.pi * lines) ** 2
    return lines[free], kept[free]


def _line_power(
    time: NDArray[np.float64], residual: NDArray[np.float64], span: float, last: int
) -> NDArray[np.float64]:
    """Power of the residual at 0..``last`` cycles per record [unit^2 per sample], (C, last + 1)."""
    plan = plan_transform(2.0 * np.pi * time / span, last)
    power: NDArray[np.float64] = np.abs(sums(plan, residual)) ** 2 / time.size
    return power


def _fit_density(
    place: NDArray[np.float64], lines: int, power: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Densities at the first ``lines`` places, where ``power`` is known, and at the others; their dof."""
    even = 2.0 * (place / place.max()) ** 2 - 1.0
    basis = np.polynomial.chebyshev.chebvander(even, _HIGHEST_DEGREE)
    best = np.full(power.shape[0], np.inf)
    log_density = np.zeros((power.shape[0], place.size))
    dof = np.zeros((power.shape[0], place.size - lines))
    for degree in range(min(_HIGHEST_DEGREE, lines // 12) + 1):
        columns = basis[:, : degree + 1]
        orthogonal, triangle = np.linalg.qr(columns[:lines])
        everywhere = np.linalg.solve(triangle.T, columns.T).T
        candidate = _maximise_likelihood(orthogonal, power) @ everywhere.T
        model = candidate[:, :lines]
        criterion = 2.0 * np.sum(model + power * np.exp(-model), axis=1) + _PENALTY * (degree + 1)
        better = criterion < best
        best = np.where(better, criterion, best)
        log_density[better] = candidate[better]
        dof[better] = 2.0 / np.sum(everywhere[lines:] ** 2, axis=1)
    density = np.exp(log_density)
    return density[:, :lines], density[:, lines:], dof


def _maximise_likelihood(basis: NDArray[np.float64], power: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients a, (C, p), of log density = basis a, by Fisher scoring; ``basis`` is orthonormal."""
    guess = np.zeros_like(power) + np.log(np.maximum(np.mean(power, axis=1, keepdims=True), 1e-300))
    coefficients: NDArray[np.float64] = guess @ basis
    for _ in range(_MOST_STEPS):
        score = power * np.exp(-(coefficients @ basis.T)) - 1.0
        step = score @ basis
        longest = np.max(np.abs(step @ basis.T), axis=1, keepdims=True)
        coefficients = coefficients + step / np.maximum(longest, 1.0)
        if float(longest.max()) < _CONVERGED:
            break
    return coefficients


def _excess(
    ratio: NDArray[np.float64], lines: NDArray[np.int64], wanted: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Factor (C, n) by which the power next to ``wanted`` stands above the fit where that is significant."""
    count = min(_NEIGHBOURS, lines.size)
    nearest = np.argsort(np.abs(lines[None] - wanted[:, None]), axis=1, kind="stable")[:, :count]
    local = np.mean(ratio[:, nearest], axis=2)
    bound = float(scipy.special.gammainccinv(count, _PEAK_SIGNIFICANCE)) / count
    return np.where(local > bound, local, 1.0), 2.0 * count


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
    how far this channel's own fundamental lies above the dwell's, ``drift_variance`` its variance [Hz^2];
    ``residual`` is what the fit of orders 0..``highest`` leaves of each sample [unit], (N,).
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
    residual: NDArray[np.float64]
    highest: int


@dataclass(frozen=True)
class DwellFit:
    """Fundamental [Hz], its standard deviation, whole periods recorded, and the channels by name."""

    frequency: float
    frequency_sd: float
    periods: int
    channels: Mapping[str, ChannelFit]


def fit_dwell(groups: tuple[ClockGroup, ...], driven: str, start: float, orders: int) -> DwellFit:
    """Fit all channels of a dwell whose frequency is near ``start`` [Hz], up to ``orders``.

    Raises :class:`numpy.linalg.LinAlgError` when the stamps do not determine the harmonics.
    """
    lead = next(group for group in groups if driven in group.names)
    frequency = refine_frequency(lead, lead.names.index(driven), start)
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
    basis, fit, highest = fit_resolved(group.time, frequency, group.values, highest, last)
    noise = estimate_noise_density(group.time, fit.residual, frequency, highest, last, group.left_out)
    floor = smallest_density(group.values)[:, None]
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
            fit.residual[i],
            highest,
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


def smallest_density(values: NDArray[np.float64]) -> NDArray[np.float64]:
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
