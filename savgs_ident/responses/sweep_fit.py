"""The local harmonics of one channel along a sweep.

Within a window of a few cycles the channel is fitted by

    y(t) = sum_{h=1..m} Re[(Y_h + Y'_h s) exp(i h theta(s))] + offset + drift s,

theta being the road's phase and s the time since the middle of the window; the response is Y_1 over the amplitude of
the road there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.recordings.recording import RecordedChannel
from savgs_ident.responses.sweep_phase import LocalPhase, RoadPhase, normal_products

_ORDERS = 7
_TRUSTED_SHARE = 0.40
_HALF_ORDERS = (0.5, 1.5, 2.5)
_NEIGHBOURS = 3


def channel_response(
    channel: RecordedChannel | None, road: RoadPhase
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
    """Response, standard deviation and validity of one channel at every window, each (W,)."""
    count = len(road.local)
    response = np.zeros(count, dtype=np.complex128)
    gain, density = np.zeros(count), np.full(count, np.nan)
    if channel is None:
        return response, gain, np.zeros(count, dtype=np.bool_)
    for w, (phase, (start, end)) in enumerate(zip(road.local, road.windows, strict=True)):
        inside = slice(*np.searchsorted(channel.time, [start, end]))
        time = channel.time[inside]
        orders = _sampled_orders(time, phase.speed / (2 * np.pi))
        if orders < 1:
            continue
        first, gain[w], density[w] = _local_harmonic(time, channel.values[inside], phase, orders)
        response[w] = first / phase.amplitude
        gain[w] /= abs(phase.amplitude)
    valid = np.isfinite(density)
    return response, gain * np.sqrt(_moving_mean(density)), valid


def _sampled_orders(time: NDArray[np.float64], frequency: float) -> int:
    """Orders to fit in a window, 0 if the sampling does not resolve the first."""
    if time.size < 8:
        return 0
    rate = (time.size - 1) / float(time[-1] - time[0])
    by_rate = int(_TRUSTED_SHARE * rate / frequency)
    by_count = (time.size // 3 - 2) // 4
    return max(min(_ORDERS, by_rate, by_count), 0)


def _local_harmonic(
    time: NDArray[np.float64], values: NDArray[np.float64], phase: LocalPhase, orders: int
) -> tuple[complex, float, float]:
    """First harmonic at mid-window, its standard deviation for unit noise, and the noise density [unit^2].

    All products of basis, probes between the harmonics and signal are taken at once. The probes' part that
    is orthogonal to the basis has the products S = G_pp - G_pb G_bb^-1 G_bp, and with the residual v; the noise
    power estimated with m probes is v' S^-1 v / m.
    """
    halves = [half for half in _HALF_ORDERS if half < orders + 1]
    basis, probes = _local_basis(time, phase, orders), _waves(phase.at(time), halves)
    products = normal_products(np.column_stack([basis, probes, values]))
    size = basis.shape[1]
    inverse = np.linalg.inv(products[:size, :size])
    weights = inverse @ products[:size, -1]
    across = products[size:-1, :size]
    innovation = products[size:-1, -1] - across @ weights
    free = products[size:-1, size:-1] - across @ inverse @ across.T
    density = float(innovation @ np.linalg.solve(free, innovation)) / innovation.size
    spread = 0.5 * (inverse[0, 0] + inverse[orders, orders])
    return complex(weights[0], -weights[orders]), float(np.sqrt(spread)), density


def _local_basis(time: NDArray[np.float64], phase: LocalPhase, orders: int) -> NDArray[np.float64]:
    """Columns of the fit at ``time`` [s], (n,): waves, waves times s, 1 and s, all within 1; (n, 4 orders + 2)."""
    unit = (time - phase.middle) / float(np.max(np.abs(time - phase.middle)))
    waves = _waves(phase.at(time), range(1, orders + 1))
    return np.column_stack([waves, waves * unit[:, None], np.ones_like(unit), unit])


def _waves(angle: NDArray[np.float64], orders: Sequence[float]) -> NDArray[np.float64]:
    """Cosines, then sines, of the ``orders`` of an ``angle`` [rad], (n,); (n, 2 orders)."""
    turns = np.exp(1j * np.outer(angle, orders))
    return np.concatenate([turns.real, turns.imag], axis=1)


def _moving_mean(density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the known values of the windows nearby; 0 where none is known."""
    known = np.isfinite(density)
    ones = np.ones(2 * _NEIGHBOURS + 1)
    total = np.convolve(np.where(known, density, 0.0), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    count = np.convolve(known.astype(np.float64), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    mean: NDArray[np.float64] = total / np.maximum(count, 1.0)
    return mean


@dataclass(frozen=True)
class WindowBasis:
    """The samples ``inside`` a window, those ``nearest`` to its middle, and the columns of the fit, (n, p)."""

    inside: slice
    nearest: slice
    columns: NDArray[np.float64]


def window_bases(time: NDArray[np.float64], road: RoadPhase) -> tuple[WindowBasis, ...]:
    """The windows of a channel sampled at ``time`` [s], (N,), those without a resolved order left out."""
    middles = np.array([phase.middle for phase in road.local])
    bounds = np.concatenate([road.windows[:1, 0], 0.5 * (middles[1:] + middles[:-1]), road.windows[-1:, 1]])
    first, last = np.searchsorted(time, road.windows.T)
    halfway = np.searchsorted(time, bounds)
    bases = []
    for w, phase in enumerate(road.local):
        inside = slice(int(first[w]), int(last[w]))
        nearest = slice(max(int(halfway[w]), inside.start), min(int(halfway[w + 1]), inside.stop))
        orders = _sampled_orders(time[inside], phase.speed / (2 * np.pi))
        if orders >= 1:
            bases.append(WindowBasis(inside, nearest, _local_basis(time[inside], phase, orders)))
    return tuple(bases)


def local_residual(
    values: NDArray[np.float64], bases: tuple[WindowBasis, ...], out: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Residual of each sample [unit], (N,), from the fit of the window nearest to it, 0 outside the windows.

    The fits are without the samples that are ``out``, (N,). Raises :class:`numpy.linalg.LinAlgError` when those left
    do not determine one.
    """
    residual = np.zeros_like(values)
    for basis in bases:
        inside, nearest, used = values[basis.inside], basis.nearest, ~out[basis.inside]
        products = normal_products(np.column_stack([basis.columns, inside])[used])
        weights = np.linalg.solve(products[:-1, :-1], products[:-1, -1])
        start = basis.inside.start
        columns = basis.columns[nearest.start - start : nearest.stop - start]
        residual[nearest] = values[nearest] - np.sum(columns * weights, axis=1)
    return residual
