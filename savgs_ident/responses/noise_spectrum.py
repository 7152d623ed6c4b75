"""The noise of a periodic record, from what does not repeat from period to period.

A periodic signal has power at the multiples of its fundamental f and nowhere else; a record of P periods also
resolves the P - 1 frequencies between two neighbouring harmonics, and power found there is noise. The power at
those frequencies, I(v) = |sum_j r_j exp(-2 pi i v t_j)|^2 / N, is exponentially distributed about the noise
density S(v) (variance per sample if the noise were white). Its logarithm is fitted by an even polynomial in
asinh(2 v / f) by maximum likelihood (Whittle), the degree chosen by an information criterion (3.5 for a
coefficient): white noise takes one coefficient and hundreds of degrees of freedom, coloured noise as many as it
needs. A peak too narrow for the polynomial is found by its excess over the neighbouring frequencies. Noise that
still rises towards zero below a few cycles per record (slow drift beyond a straight line) is understated at order
0, and only there: its level there is not in the record.

References: P. Whittle, Ark. Mat. 2 (1953) 423; R. Pintelon, J. Schoukens, System Identification: A
Frequency Domain Approach (2012), chapter 2 (noise from non-excited frequencies).
"""

from dataclasses import dataclass

import numpy as np
import scipy.special
from numpy.typing import NDArray

from savgs_ident.responses.periodic_fit import plan_transform, sums

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
    time: NDArray[np.float64], residual: NDArray[np.float64], frequency: float, highest: int, orders: int
) -> NoiseDensity:
    """Noise density at orders 0..``orders`` of ``residual`` (C, N), left by a fit of orders 0..``highest``.

    ``time`` [s] of shape (N,), ``frequency`` [Hz] the fundamental. Beyond the last frequency that the data
    resolve, the density is that of the last one.
    """
    span = float(time[-1] - time[0]) * time.size / (time.size - 1)
    lines, kept = _lines_between(span * frequency, time.size, highest, orders)
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
