"""Time nodes of periodic solutions, dense where the acceleration moves fast.

A friction that sticks turns the acceleration round within a few milliseconds of a period that may last two
seconds. Equal steps waste nodes; here the nodes follow the arc length of the acceleration in an earlier,
coarser solution: half of them are spread evenly over the period, half in proportion to how much the
accelerations change. The map from node number to time is smooth, so that sums over the nodes, weighted with
the map's own derivative, converge as fast as they do on equal steps.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SPREAD = 0.5
"""Share of the nodes that follows the accelerations; the rest is spread evenly."""

_FINE = 2048
_SMOOTHING = 1.0 / 160.0
_SMOOTHING_TIME = 3e-3


class Mesh(NamedTuple):
    """Nodes over one period of D dwells, N each.

    Attributes:
        phase: phase of the nodes [rad], (D, N), growing from 0.
        gap: phase from each node to the next, cyclically [rad], (D, N); sums to 2 pi.
        weight: quadrature weights of the mean over the period, (D, N); sum to 1.
    """

    phase: NDArray[np.float64]
    gap: NDArray[np.float64]
    weight: NDArray[np.float64]


def uniform_mesh(dwells: int, nodes: int) -> Mesh:
    """Equal steps for every dwell."""
    phase = np.tile(2.0 * np.pi * np.arange(nodes) / nodes, (dwells, 1))
    return Mesh(phase, np.full_like(phase, 2.0 * np.pi / nodes), np.full_like(phase, 1.0 / nodes))


def adapted_mesh(
    mesh: Mesh, accelerations: NDArray[np.float64], frequency: NDArray[np.float64], nodes: int
) -> Mesh:
    """``nodes`` nodes per dwell that follow ``accelerations`` (A, D, n) known on an earlier ``mesh``.

    The accelerations may have any units: each counts by the share of its own total variation.
    """
    rates = np.abs(np.roll(accelerations, -1, axis=-1) - accelerations)
    totals = np.maximum(rates.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    share = (rates / totals).mean(axis=0)
    width = np.minimum(_SMOOTHING, _SMOOTHING_TIME * frequency)
    return _stack([_nodes_of_dwell(*row, nodes) for row in zip(mesh.phase, share, width, strict=True)])


def _nodes_of_dwell(phase: np.ndarray, share: np.ndarray, width: float, nodes: int) -> np.ndarray:
    """Phases at which the cumulative node density passes 0, 1/N, 2/N, ..."""
    grid = 2.0 * np.pi * np.arange(_FINE + 1) / _FINE
    edges = np.append(phase, phase[0] + 2.0 * np.pi)
    cumulative = np.append(0.0, np.cumsum(share))
    wrapped = np.interp(grid, edges, cumulative)
    density = _smoothed(np.diff(wrapped), width)
    total = (1.0 - SPREAD) * grid / (2.0 * np.pi) + SPREAD * np.append(
        0.0, np.cumsum(density)
    ) / density.sum()
    return np.interp(np.arange(nodes) / nodes, total, grid)


def _smoothed(density: np.ndarray, width: float) -> np.ndarray:
    """Periodic Gaussian smoothing over a fraction of the period."""
    order = np.fft.rfftfreq(density.size, d=1.0 / density.size)
    return np.fft.irfft(np.fft.rfft(density) * np.exp(-2.0 * (np.pi * order * width) ** 2), density.size)


def _stack(rows: list[np.ndarray]) -> Mesh:
    phase = np.stack(rows)
    nodes = phase.shape[1]
    gap = np.diff(phase, axis=1, append=phase[:, :1] + 2.0 * np.pi)
    uniform = 2.0 * np.pi * np.arange(nodes) / nodes
    spectrum = np.fft.rfft(phase - uniform, axis=1)
    order = np.arange(spectrum.shape[1])
    order[-1] = 0
    slope = 1.0 + np.fft.irfft(1j * order * spectrum, nodes, axis=1)
    return Mesh(phase, gap, slope / nodes)
