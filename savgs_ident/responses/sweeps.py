"""Sweeps to a response: the local first harmonic relative to the road, at the road's instantaneous phase.

The road's zero crossings, taken with hysteresis, give its phase to a few degrees; within a window of a few cycles
the phase is refined by least squares on

    z(t) = Re[A exp(i (w s + b s^2 / 2))] + offset + slope s,      s = t - t_window.

Within the same window every channel is fitted by

    y(t) = sum_{h=1..m} Re[(Y_h + Y'_h s) exp(i h theta(s))] + offset + drift s,

theta being the road's phase; the response is Y_1 / A at the middle of the window.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.harmonic_response import SweepResponse

_ORDERS = 7
_TRUSTED_SHARE = 0.40
_HALF_ORDERS = (0.5, 1.5, 2.5)
_NEIGHBOURS = 3
_CROSSING_THRESHOLD = 0.3
_MOST_PHASE_STEPS = 8


@dataclass(frozen=True)
class LocalPhase:
    """Phase of the road about ``middle`` [s]: w [rad/s], b [rad/s^2], complex amplitude A [m], sd of w."""

    middle: float
    speed: float
    acceleration: float
    amplitude: complex
    speed_sd: float

    def at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Phase [rad] at ``time`` [s], (n,), 0 at the middle."""
        since = time - self.middle
        return self.speed * since + 0.5 * self.acceleration * since**2


def estimate_sweep_response(
    recording: Recording, driven: str, cycles: float = 4.0, overlap: float = 0.5, source: str = ""
) -> SweepResponse:
    """First harmonic of each channel per unit of the input ``driven``, called the road below, along one sweep.

    ``cycles`` is the length of a window in cycles of the road, ``overlap`` the share that neighbours have in
    common (their errors are correlated accordingly). The road's amplitude is taken as constant within a
    window, as a cam makes it.

    The standard deviation comes from the residual between the harmonics (orders 1/2, 3/2, 5/2), averaged over
    three windows to either side: about 20 degrees of freedom. It does not contain two biases. First, the
    response to a sweep is not the steady one: for a linear system H it is H - (i/2) (dw/dt) H''(w) + ..., so
    that peaks come later in the direction of the sweep, the more the faster it is and the sharper they are;
    and the transient of the start has to die out. Second, curvature of the response within a window, about
    H''(w) (dw/dt)^2 T^2 / 24 for a window of T seconds. Compare a sweep with a simulated sweep that went
    through this same function: both biases then cancel.

    Raises :class:`InputError` when the road is missing or moves fewer than ``cycles`` + 1 cycles.
    """
    road = _usable(recording.channels.get(driven))
    if road is None or np.ptp(road.values) == 0.0:
        raise InputError(
            "the sweep has no road motion to refer to",
            source=source,
            test=recording.name,
            channel=driven,
            remedy="map the road channel, or leave this test out",
        )
    phases, windows = _road_windows(recording.name, road, cycles, overlap, source)
    names = [name for name in recording.channels if name != driven]
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


def _usable(channel: RecordedChannel | None) -> RecordedChannel | None:
    """The channel without samples that are not finite."""
    if channel is None:
        return None
    keep = np.isfinite(channel.values) & np.isfinite(channel.time)
    if np.count_nonzero(keep) < 2:
        return None
    return RecordedChannel(
        channel.name, channel.unit, channel.time[keep], channel.values[keep], channel.source
    )


def _road_windows(
    test: str, road: RecordedChannel, cycles: float, overlap: float, source: str
) -> tuple[list[LocalPhase], NDArray[np.float64]]:
    """Local phases and the windows' first and last instants [s], (W, 2)."""
    times = crossing_times(road.time, road.values)
    if times.size < 2.0 * (cycles + 1.0):
        raise InputError(
            f"the road moves {max(times.size - 1, 0) / 2:g} cycles, {cycles + 1:g} are needed",
            source=source,
            test=test,
            channel=road.name,
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


def crossing_times(time: NDArray[np.float64], road: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times [s], (k,), at which the road (n,) passes mid stroke, up and down in turn.

    A passage runs from one threshold, 30 % of the amplitude off the middle, to the opposite one; its time is
    that of a straight line through the samples in between, so that noise near zero does not multiply it.
    """
    middle = 0.5 * (np.max(road) + np.min(road))
    height = road - middle
    level = _CROSSING_THRESHOLD * float(np.max(np.abs(height)))
    side = np.where(height > level, 1, np.where(height < -level, -1, 0))
    outside = np.flatnonzero(side)
    turns = np.flatnonzero(side[outside[1:]] != side[outside[:-1]])
    return np.array(
        [
            _passage(time, height, int(a), int(b))
            for a, b in zip(outside[turns], outside[turns + 1], strict=True)
        ]
    )


def phase_at_crossings(times: NDArray[np.float64]) -> PchipInterpolator:
    """Monotone phase [rad] over time, pi more at each crossing, (k,)."""
    return PchipInterpolator(times, np.pi * np.arange(times.size))


def refine_phase(
    time: NDArray[np.float64], road: NDArray[np.float64], middle: float, speed: float, acceleration: float
) -> LocalPhase:
    """Least-squares phase of ``road`` (N,) [m] about ``middle``, from a guess of w and b (Gauss-Newton)."""
    since = time - middle
    reach = float(np.max(np.abs(since)))
    unit = since / reach
    for _ in range(_MOST_PHASE_STEPS):
        phase = speed * since + 0.5 * acceleration * since**2
        cosine, sine = np.cos(phase), np.sin(phase)
        waves = np.column_stack([cosine, sine, np.ones_like(unit), unit])
        weights = np.linalg.solve(normal_products(waves), np.sum(waves * road[:, None], axis=0))
        along = weights[1] * cosine - weights[0] * sine
        columns = np.column_stack([waves, along * unit, along * unit**2])
        left = road - np.sum(waves * weights, axis=1)
        inverse = np.linalg.inv(normal_products(columns))
        step = inverse @ np.sum(columns * left[:, None], axis=0)
        speed += step[4] / reach
        acceleration += 2.0 * step[5] / reach**2
        if abs(step[4]) + abs(step[5]) < 1e-9:
            break
    remainder = left - np.sum(columns * step, axis=1)
    variance = float(np.sum(remainder**2)) / max(time.size - 6, 1)
    amplitude = complex(weights[0], -weights[1])
    speed_sd = float(np.sqrt(inverse[4, 4] * variance)) / reach
    return LocalPhase(middle, float(speed), float(acceleration), amplitude, speed_sd)


def _passage(time: NDArray[np.float64], height: NDArray[np.float64], first: int, last: int) -> float:
    part = slice(first, last + 1)
    origin = 0.5 * float(time[first] + time[last])
    since = time[part] - origin
    if last == first + 1:
        return origin - float(since[0] + since[1]) / 2.0 + float(_zero_of_chord(since, height[part]))
    slope, level = np.polyfit(since, height[part], 1)
    return origin - float(level / slope)


def _zero_of_chord(time: NDArray[np.float64], height: NDArray[np.float64]) -> float:
    return float(time[0] - height[0] * (time[1] - time[0]) / (height[1] - height[0]))


def _channel_response(
    channel: RecordedChannel | None, phases: list[LocalPhase], windows: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
    """Response, standard deviation and validity of one channel at every window, each (W,)."""
    response = np.zeros(len(phases), dtype=np.complex128)
    gain, density = np.zeros(len(phases)), np.full(len(phases), np.nan)
    if channel is None:
        return response, gain, np.zeros(len(phases), dtype=np.bool_)
    for w, (phase, (start, end)) in enumerate(zip(phases, windows, strict=True)):
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
    innovation = products[size:-1, -1] - across @ weights
    free = products[size:-1, size:-1] - across @ inverse @ across.T
    density = float(innovation @ np.linalg.solve(free, innovation)) / innovation.size
    spread = 0.5 * (inverse[0, 0] + inverse[orders, orders])
    return complex(weights[0], -weights[orders]), float(np.sqrt(spread)), density


def _moving_mean(density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the known values of the windows nearby; 0 where none is known."""
    known = np.isfinite(density)
    ones = np.ones(2 * _NEIGHBOURS + 1)
    total = np.convolve(np.where(known, density, 0.0), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    count = np.convolve(known.astype(np.float64), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    mean: NDArray[np.float64] = total / np.maximum(count, 1.0)
    return mean


_BLOCK_ROWS = 128
"""So few rows that the linear algebra library does not start threads: starting them costs more than the product
itself, and many times more on a busy machine."""


def normal_products(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """A' A of ``columns`` of any unit, (N, p), shape (p, p), for a p of a few tens."""
    total = np.zeros((columns.shape[1], columns.shape[1]))
    for start in range(0, columns.shape[0], _BLOCK_ROWS):
        part = columns[start : start + _BLOCK_ROWS]
        total += part.T @ part
    return total
