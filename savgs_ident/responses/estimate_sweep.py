"""Sweeps to a response: the local first harmonic relative to the road, at the road's instantaneous phase.

Within a window of a few cycles every channel is fitted by

    y(t) = sum_{h=1..m} Re[(Y_h + Y'_h s) exp(i h theta(s))] + offset + drift s,      s = t - t_window,

theta being the road's phase there; the response is Y_1 / A at the middle of the window.
"""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import CANONICAL_UNITS, Channel, Recording
from savgs_ident.responses.products import normal_products
from savgs_ident.responses.road_phase import LocalPhase, crossing_times, phase_at_crossings, refine_phase
from savgs_ident.responses.sweep_response import SweepResponse

ROAD = "road_height"
_ORDERS = 7
_TRUSTED_SHARE = 0.40
_HALF_ORDERS = (0.5, 1.5, 2.5)
_NEIGHBOURS = 3


def estimate_sweep_response(
    recording: Recording, cycles: float = 4.0, overlap: float = 0.5, source: str = ""
) -> SweepResponse:
    """First harmonic of each channel per metre of road along one sweep.

    ``cycles`` is the length of a window in cycles of the road, ``overlap`` the share that neighbours have in
    common (their errors are correlated accordingly). The road's amplitude is taken as constant within a
    window, as a cam makes it.

    The standard deviation comes from the residual between the harmonics (orders 1/2, 3/2, 5/2), averaged over
    three windows to either side: about 20 degrees of freedom. It does not hold two biases. First, the
    response to a sweep is not the steady one: for a linear system H it is H - (i/2) (dw/dt) H''(w) + ..., so
    that peaks come later in the direction of the sweep, the more the faster it is and the sharper they are;
    and what the start has excited has to die out. Second, curvature of the response within a window, about
    H''(w) (dw/dt)^2 T^2 / 24 for a window of T seconds. Compare a sweep with a simulated sweep that went
    through this same function: both biases then cancel.

    Raises :class:`InputError` when the road is missing or moves fewer than ``cycles`` + 1 cycles.
    """
    road = _usable(recording.channels.get(ROAD))
    if road is None or np.ptp(road.values) == 0.0:
        raise InputError(
            "the sweep has no road motion to refer to",
            source=source,
            test=recording.name,
            channel=ROAD,
            remedy="map the road channel, or leave this test out",
        )
    phases, windows = _road_windows(recording.name, road, cycles, overlap, source)
    names = [name for name in CANONICAL_UNITS if name in recording.channels and name != ROAD]
    names += sorted(set(recording.channels) - set(names) - {ROAD})
    columns = [_channel_response(_usable(recording.channels[name]), phases, windows) for name in names]
    return SweepResponse(
        test=recording.name,
        channels=tuple(names),
        time=np.array([phase.middle for phase in phases]),
        frequency=np.array([phase.speed for phase in phases]) / (2 * np.pi),
        frequency_sd=np.array([phase.speed_sd for phase in phases]) / (2 * np.pi),
        sweep_rate=np.array([phase.acceleration for phase in phases]) / (2 * np.pi),
        window_s=windows[:, 1] - windows[:, 0],
        road_amplitude=np.array([abs(phase.amplitude) for phase in phases]),
        response=np.stack([column[0] for column in columns], axis=1),
        response_sd=np.stack([column[1] for column in columns], axis=1),
        valid=np.stack([column[2] for column in columns], axis=1),
    )


def _usable(channel: Channel | None) -> Channel | None:
    """The channel without samples that are not finite."""
    if channel is None:
        return None
    keep = np.isfinite(channel.values) & np.isfinite(channel.time)
    if np.count_nonzero(keep) < 2:
        return None
    return Channel(channel.name, channel.unit, channel.time[keep], channel.values[keep], channel.source)


def _road_windows(
    test: str, road: Channel, cycles: float, overlap: float, source: str
) -> tuple[list[LocalPhase], NDArray[np.float64]]:
    """Local phases and the windows' first and last instants [s], (W, 2)."""
    times = crossing_times(road.time, road.values)
    if times.size < 2.0 * (cycles + 1.0):
        raise InputError(
            f"the road moves {max(times.size - 1, 0) / 2:g} cycles, {cycles + 1:g} are needed",
            source=source,
            test=test,
            channel=ROAD,
            remedy="use shorter windows or a longer sweep",
        )
    phase_over_time = phase_at_crossings(times)
    total = np.pi * (times.size - 1)
    half = np.pi * cycles
    middles = np.arange(half, total - half, 2.0 * half * (1.0 - overlap))
    marks = np.pi * np.arange(times.size)
    edges = np.stack([np.interp(middles + side * half, marks, times) for side in (-1.0, 0.0, 1.0)], axis=1)
    phases = []
    for start, middle, end in edges:
        inside = (road.time >= start) & (road.time <= end)
        nodes = np.linspace(start, end, 4 * int(cycles) + 1)
        bend, speed, _ = np.polyfit(nodes - middle, phase_over_time(nodes), 2)
        phases.append(refine_phase(road.time[inside], road.values[inside], middle, speed, 2.0 * bend))
    return phases, edges[:, [0, 2]]


def _channel_response(
    channel: Channel | None, phases: list[LocalPhase], windows: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
    """Response, standard deviation and validity of one channel at every window, each (W,)."""
    response = np.zeros(len(phases), dtype=np.complex128)
    gain, density = np.zeros(len(phases)), np.full(len(phases), np.nan)
    if channel is None:
        return response, gain, np.zeros(len(phases), dtype=np.bool_)
    for w, (phase, (start, end)) in enumerate(zip(phases, windows, strict=True)):
        inside = slice(*np.searchsorted(channel.time, [start, end]))
        time = channel.time[inside]
        orders = _orders_carried(time, phase.speed / (2 * np.pi))
        if orders < 1:
            continue
        first, gain[w], density[w] = _local_harmonic(time, channel.values[inside], phase, orders)
        response[w] = first / phase.amplitude
        gain[w] /= abs(phase.amplitude)
    valid = np.isfinite(density)
    return response, gain * np.sqrt(_moving_mean(density)), valid


def _orders_carried(time: NDArray[np.float64], frequency: float) -> int:
    """Orders to fit in a window, 0 if the sampling does not carry the first."""
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
    the basis cannot imitate has the products S = G_pp - G_pb G_bb^-1 G_bp, and with the residual v; the noise
    power seen through m probes is v' S^-1 v / m.
    """
    angle = phase.at(time)
    unit = (time - phase.middle) / float(np.max(np.abs(time - phase.middle)))
    halves = [half for half in _HALF_ORDERS if half < orders + 1]
    turns = np.exp(1j * np.outer(angle, [*range(1, orders + 1), *halves]))
    waves = np.concatenate([turns.real[:, :orders], turns.imag[:, :orders]], axis=1)
    probes = np.concatenate([turns.real[:, orders:], turns.imag[:, orders:]], axis=1)
    columns = np.column_stack([waves, waves * unit[:, None], np.ones_like(unit), unit, probes, values])
    products = normal_products(columns)
    size = 4 * orders + 2
    inverse = np.linalg.inv(products[:size, :size])
    weights = inverse @ products[:size, -1]
    across = products[size:-1, :size]
    seen = products[size:-1, -1] - across @ weights
    free = products[size:-1, size:-1] - across @ inverse @ across.T
    density = float(seen @ np.linalg.solve(free, seen)) / seen.size
    spread = 0.5 * (inverse[0, 0] + inverse[orders, orders])
    return complex(weights[0], -weights[orders]), float(np.sqrt(spread)), density


def _moving_mean(density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the windows nearby of what is known there; 0 where nothing is."""
    known = np.isfinite(density)
    ones = np.ones(2 * _NEIGHBOURS + 1)
    total = np.convolve(np.where(known, density, 0.0), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    count = np.convolve(known.astype(np.float64), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    mean: NDArray[np.float64] = total / np.maximum(count, 1.0)
    return mean
