"""The phase of the driven input along a sweep.

Its zero crossings, taken with hysteresis, give the phase to a few degrees; within a window of a few cycles
the phase is refined by least squares on

    z(t) = Re[A exp(i (w s + b s^2 / 2))] + offset + slope s,      s = t - t_window.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import RecordedChannel

_CROSSING_THRESHOLD = 0.3
_MOST_PHASE_STEPS = 8


@dataclass(frozen=True)
class LocalPhase:
    """Phase of the input about ``middle`` [s]: w [rad/s], b [rad/s^2], complex amplitude A [its unit], sd of w.

    ``miss`` is the rms of what the fit leaves of it [its unit].
    """

    middle: float
    speed: float
    acceleration: float
    amplitude: complex
    speed_sd: float
    miss: float

    def at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Phase [rad] at ``time`` [s], (n,), 0 at the middle."""
        since = time - self.middle
        return self.speed * since + 0.5 * self.acceleration * since**2


@dataclass(frozen=True)
class InputPhase:
    """Local phases of the driven input, the first and last instants of their ``windows`` [s], (W, 2).

    ``crossings`` are the times [s], (k,), at which it passes mid stroke.
    """

    local: tuple[LocalPhase, ...]
    windows: NDArray[np.float64]
    crossings: NDArray[np.float64]

    def periods_at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Phase [periods] at ``time`` [s], (n,), from the crossings alone."""
        phase: NDArray[np.float64] = phase_at_crossings(self.crossings)(time) / (2.0 * np.pi)
        return phase

    def only(self, kept: NDArray[np.bool_]) -> "InputPhase":
        """The windows that are ``kept``, (W,)."""
        local = tuple(phase for phase, keep in zip(self.local, kept, strict=True) if keep)
        return InputPhase(local, self.windows[kept], self.crossings)


def follow_input(test: str, lead: RecordedChannel, cycles: float, overlap: float, source: str) -> InputPhase:
    """Local phases in windows of ``cycles`` cycles, of which neighbours share ``overlap``.

    ``lead`` is the driven channel. Raises :class:`InputError` when it moves too few cycles, or when its samples do
    not determine its phase.
    """
    times = crossing_times(lead.time, lead.values)
    if times.size < 2.0 * (cycles + 1.0):
        raise InputError(
            f"{lead.name} moves {max(times.size - 1, 0) / 2:g} cycles, {cycles + 1:g} are needed",
            source=source,
            test=test,
            channel=lead.name,
            remedy="use shorter windows or a longer sweep",
        )
    try:
        return _local_phases(lead, times, cycles, overlap)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise InputError(
            f"its samples do not determine the phase of {lead.name}",
            source=source,
            test=test,
            channel=lead.name,
            remedy="sample faster, and check the sensor's cable and the logger",
        ) from error


def _local_phases(
    lead: RecordedChannel, times: NDArray[np.float64], cycles: float, overlap: float
) -> InputPhase:
    """Raises :class:`ValueError` for crossings that do not follow one another."""
    phase_over_time = phase_at_crossings(times)
    total = np.pi * (times.size - 1)
    half = np.pi * cycles
    middles = np.arange(half, total - half, 2.0 * half * (1.0 - overlap))
    marks = np.pi * np.arange(times.size)
    edges = np.stack([np.interp(middles + side * half, marks, times) for side in (-1.0, 0.0, 1.0)], axis=1)
    phases = []
    for start, middle, end in edges:
        inside = (lead.time >= start) & (lead.time <= end)
        nodes = np.linspace(start, end, 4 * int(cycles) + 1)
        bend, speed, _ = np.polyfit(nodes - middle, phase_over_time(nodes), 2)
        phases.append(refine_phase(lead.time[inside], lead.values[inside], middle, speed, 2.0 * bend))
    return InputPhase(tuple(phases), edges[:, [0, 2]], times)


def crossing_times(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times [s], (k,), at which ``values`` (n,) of any unit pass mid stroke, up and down in turn.

    A passage runs from one threshold, 30 % of the amplitude off the middle, to the opposite one; its time is
    that of a straight line through the samples in between, so that noise near zero does not multiply it.
    """
    middle = 0.5 * (np.max(values) + np.min(values))
    height = values - middle
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
    time: NDArray[np.float64], values: NDArray[np.float64], middle: float, speed: float, acceleration: float
) -> LocalPhase:
    """Least-squares phase of ``values`` (N,) of any unit about ``middle``, from a guess of w and b (Gauss-Newton)."""
    since = time - middle
    half = float(np.max(np.abs(since)))
    unit = since / half
    for _ in range(_MOST_PHASE_STEPS):
        phase = speed * since + 0.5 * acceleration * since**2
        cosine, sine = np.cos(phase), np.sin(phase)
        waves = np.column_stack([cosine, sine, np.ones_like(unit), unit])
        weights = np.linalg.solve(normal_products(waves), np.sum(waves * values[:, None], axis=0))
        along = weights[1] * cosine - weights[0] * sine
        columns = np.column_stack([waves, along * unit, along * unit**2])
        left = values - np.sum(waves * weights, axis=1)
        inverse = np.linalg.inv(normal_products(columns))
        step = inverse @ np.sum(columns * left[:, None], axis=0)
        speed += step[4] / half
        acceleration += 2.0 * step[5] / half**2
        if abs(step[4]) + abs(step[5]) < 1e-9:
            break
    remainder = left - np.sum(columns * step, axis=1)
    variance = float(np.sum(remainder**2)) / max(time.size - 6, 1)
    amplitude = complex(weights[0], -weights[1])
    speed_sd = float(np.sqrt(inverse[4, 4] * variance)) / half
    miss = float(np.sqrt(np.mean(remainder**2)))
    return LocalPhase(middle, float(speed), float(acceleration), amplitude, speed_sd, miss)


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
