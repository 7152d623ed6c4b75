"""The instantaneous phase of a road signal whose frequency changes.

Zero crossings, taken with hysteresis, give the phase to a few degrees wherever the road goes through mid
stroke; within a window of a few cycles it is then refined by least squares on

    z(t) = Re[A exp(i (w s + b s^2 / 2))] + offset + slope s,      s = t - t_window.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from savgs_ident.responses.products import normal_products

_THRESHOLD = 0.3
_ROUNDS = 8


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


def crossing_times(time: NDArray[np.float64], road: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times [s], (k,), at which the road (n,) passes mid stroke, up and down in turn.

    A passage runs from one threshold, 30 % of the amplitude off the middle, to the opposite one; its time is
    that of a straight line through the samples in between, so that noise near zero does not multiply it.
    """
    middle = 0.5 * (np.max(road) + np.min(road))
    height = road - middle
    level = _THRESHOLD * float(np.max(np.abs(height)))
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
    for _ in range(_ROUNDS):
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
