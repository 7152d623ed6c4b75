"""What a sensor resolves: its noise, or the steps in which it counts, and the speed that cannot be told from none.

Noise is read from what is rough in values: their third differences, in which all that is smooth over some of them is
gone.
"""

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

NORMAL = 1.4826
"""Standard deviation of a normal number over the median of its size [1]."""

AT_REST = 3.0
"""Speeds up to so many standard deviations of the speed's noise do not tell which way a motion goes. Origin: beyond
three, one sample of four hundred does."""

STEADY_S, STEADY_SAMPLES = 0.25, 16
"""Time [s], and samples at least, over which a speed that changes by its noise alone is taken as one."""

ROUNDED, COUNTED, WHOLE = 1e-9, 10.0, 0.05
"""How a sensor that counts is known: its changes that are more than a rounding, as a share of all that it shows, and
up to so many counts, are whole numbers of counts to within this [1]."""


def roughness(rows: NDArray[np.float64]) -> float:
    """Standard deviation of white noise in values (n,) that are smooth but for that, in their unit."""
    # The squares of the binomial coefficients 1, 3, 3, 1 add up to 20.
    return float(NORMAL * np.median(np.abs(np.diff(rows, 3))) / np.sqrt(20.0))


def resolution(values: NDArray[np.float64]) -> float:
    """Standard deviation of what a sensor does not resolve in values (n,), in their unit: noise, or its steps."""
    return max(roughness(values), _step_of(values) / sqrt(12.0))


def _step_of(values: NDArray[np.float64]) -> float:
    """Step of a sensor that counts, from values (n,), in their unit: its changes are multiples of it; 0 otherwise."""
    changes = np.abs(np.diff(values))
    changes = changes[changes > ROUNDED * np.ptp(values)]
    if not changes.size:
        return 0.0
    least = float(np.quantile(changes, 0.01))
    counts = changes[changes < COUNTED * least] / least
    return least if np.median(np.abs(counts - np.round(counts))) < WHOLE else 0.0


def noise_of_speed(speed: NDArray[np.float64], step: float, cutoff: float) -> float:
    """Standard deviation of the noise of a measured ``speed`` (n,), in its unit, below ``cutoff`` [Hz].

    ``step`` is the time between samples [s].
    """
    return resolution(speed) * sqrt(2.0 * cutoff * step)


def noise_of_rate(position: NDArray[np.float64], step: float, cutoff: float) -> float:
    """The same of the rate of a measured ``position`` (n,), in its unit per second."""
    return 2.0 * pi * resolution(position) * sqrt(2.0 * step * cutoff**3 / 3.0)


def unresolved(speed: NDArray[np.float64], noise: float, step: float, cutoff: float) -> NDArray[np.bool_]:
    """Where a ``speed`` (n,) below ``cutoff`` [Hz], with ``noise`` (sd, its unit), does not tell which way it goes.

    Its mean tells it where the speed changes by its noise alone.
    """
    # Takes a second to import, which a diagnosis on dwells would wait for.
    from scipy.ndimage import uniform_filter1d

    size = max(round(STEADY_S / step), STEADY_SAMPLES)
    mean, squares = (uniform_filter1d(each, size, mode="nearest") for each in (speed, speed**2))
    limit = AT_REST * noise
    alike = squares - mean**2 < limit**2
    known = np.abs(mean) * np.sqrt(2.0 * cutoff * step * size) > limit
    return np.asarray((np.abs(speed) < limit) & ~(alike & known))
