"""Smooth densities of draws, and the regions that hold most of them.

A density is a fine histogram smoothed by a normal kernel whose width follows Silverman's rule for as many
independent draws as there effectively are: correlated draws promise no finer detail.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d

_FINE = 240
_COARSE = 90


def limits_of(draws: NDArray[np.float64], *others: float) -> tuple[float, float]:
    """Limits of an axis that shows nearly all ``draws`` and every one of ``others`` that is finite.

    ``draws`` (n,) and limits are in the same unit.
    """
    inner = np.quantile(draws, (0.002, 0.998))
    known = [value for value in others if np.isfinite(value)]
    low, high = min(float(inner[0]), *known, np.inf), max(float(inner[1]), *known, -np.inf)
    # A chain that never moved has no width of its own.
    room = 0.1 * (high - low) or 1e-3 * abs(high) or 1.0
    return low - room, high + room


def smooth_density(
    draws: NDArray[np.float64], limits: tuple[float, float], effective: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n,) between ``limits`` and the density there [1/unit], (n,); its area is 1.

    ``effective`` is how many independent draws the correlated ones are worth.
    """
    counts, edges = np.histogram(draws, bins=_FINE, range=limits)
    step = (limits[1] - limits[0]) / _FINE
    width = 1.06 * float(np.std(draws)) * _worth(draws, effective) ** -0.2 / step
    smooth = gaussian_filter1d(counts.astype(np.float64), max(width, 0.5), mode="constant")
    return 0.5 * (edges[1:] + edges[:-1]), smooth / (np.sum(smooth) * step)


def joint_density(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    limits: tuple[tuple[float, float], tuple[float, float]],
    effective: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Points on x (n,) and on y (n,), and the share of the draws around each pair, (n, n), rows along y."""
    counts, along_x, along_y = np.histogram2d(x, y, bins=_COARSE, range=limits)
    steps = [(high - low) / _COARSE for low, high in limits]
    narrow = _worth(x, effective) ** (-1.0 / 6.0)
    widths = [max(float(np.std(v)) * narrow / step, 0.5) for v, step in zip((x, y), steps, strict=True)]
    smooth = gaussian_filter(counts, widths, mode="constant")
    centres = [0.5 * (edges[1:] + edges[:-1]) for edges in (along_x, along_y)]
    return centres[0], centres[1], smooth.T / np.sum(smooth)


def region_levels(shares: NDArray[np.float64], contents: Sequence[float]) -> list[float]:
    """Heights above which the densest regions hold these ``contents`` of all draws, in increasing order.

    ``shares`` of the draws are of any shape.
    """
    falling = np.sort(shares.ravel())[::-1]
    held = np.cumsum(falling)
    levels = [falling[min(int(np.searchsorted(held, content)), held.size - 1)] for content in contents]
    return sorted(float(level) for level in levels)


def _worth(draws: NDArray[np.float64], effective: float) -> float:
    return float(np.clip(effective, 10.0, draws.size)) if np.isfinite(effective) else 10.0
