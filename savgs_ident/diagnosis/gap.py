"""The gap in per cent of the response: relative rms over tests, channels pooled by their own signal power.

Where in the response the gap lies: by channel, frequency and order, and by position in the cycle.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.result import CyclePosition, MapCell, Shrink
from savgs_ident.inference.observations import Data

if TYPE_CHECKING:
    from savgs_ident.diagnosis.dwell_problem import DwellProblem

RESAMPLES = 500
"""Campaigns drawn by resampling the tests."""

SEED = 7


@dataclass(frozen=True)
class Rows:
    """Rows of the three models, (m,) each, and the channel of each row, an index of the names of ``channels``.

    Rows are in the unit of their reading.
    """

    before: NDArray[np.float64]
    recalibrated: NDArray[np.float64]
    after: NDArray[np.float64]
    channel: NDArray[np.intp]
    channels: tuple[str, ...]


def shrinks(data: Data, rows: Rows) -> tuple[Shrink, dict[str, Shrink]]:
    """The gap of all channels together, and of each."""
    power = _by_test(data, rows, data.measured**2)
    squares = {
        "before": _by_test(data, rows, (data.measured - rows.before) ** 2),
        "recalibrated": _by_test(data, rows, (data.measured - rows.recalibrated) ** 2),
        "after": _by_test(data, rows, (data.measured - rows.after) ** 2),
        "floor": _by_test(data, rows, data.variance),
    }
    scatter = _by_test(data, rows, 2.0 * data.variance**2)
    present = [c for c in range(len(rows.channels)) if np.any(rows.channel == c)]
    together = _shrink(squares, power, scatter, present)
    return together, {rows.channels[c]: _shrink(squares, power, scatter, [c]) for c in present}


def _by_test(data: Data, rows: Rows, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums by test and channel, (t, C)."""
    out = np.zeros((data.tests, len(rows.channels)))
    np.add.at(out, (data.test, rows.channel), values)
    return out


def _relative(
    square: NDArray[np.float64], power: NDArray[np.float64], channels: list[int]
) -> NDArray[np.float64]:
    """Relative mean squares over the last but one axis, pooled over the channels that were measured there."""
    squares, powers = square[..., channels].sum(axis=-2), power[..., channels].sum(axis=-2)
    measured = powers > 0.0
    shares = np.divide(squares, powers, out=np.zeros_like(squares), where=measured)
    return np.asarray(shares.sum(axis=-1) / measured.sum(axis=-1))


def _shrink(
    squares: dict[str, NDArray[np.float64]],
    power: NDArray[np.float64],
    scatter: NDArray[np.float64],
    channels: list[int],
) -> Shrink:
    """The gap in some channels, by sums over rows in each test and channel, (t, C).

    These are the ``squares`` of residuals and noise, those of what was measured (``power``), and the variance of the
    noise's squares (``scatter``).
    """
    whole = {name: float(_relative(square, power, channels)) for name, square in squares.items()}
    tests = np.random.default_rng(SEED).integers(0, len(power), (RESAMPLES, len(power)))
    drawn = {name: _relative(square[tests], power[tests], channels) for name, square in squares.items()}
    return Shrink(
        **{name: float(np.sqrt(value)) for name, value in whole.items()},
        share_closed=float(_closed(*(np.array(whole[name]) for name in ("before", "after", "floor")))),
        interval=_interval(_closed(drawn["before"], drawn["after"], drawn["floor"])),
        interval_by_effect=_interval(_closed(drawn["recalibrated"], drawn["after"], drawn["floor"])),
        scatter=_scatter(scatter, power, channels),
    )


def _scatter(scatter: NDArray[np.float64], power: NDArray[np.float64], channels: list[int]) -> float:
    """Standard deviation [1] of a relative mean square that is that of the noise."""
    variances, powers = scatter[:, channels].sum(axis=1), power[:, channels].sum(axis=1)
    measured = powers > 0.0
    return float(np.sqrt(np.sum(variances[measured] / powers[measured] ** 2)) / measured.sum())


def _interval(drawn: NDArray[np.float64]) -> tuple[float, float]:
    """The middle 95 % of resampled shares [1]; NaN where there was nothing to close in any sample."""
    if not np.isfinite(drawn).any():
        return np.nan, np.nan
    low, high = np.nanquantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def _closed(
    before: NDArray[np.float64], after: NDArray[np.float64], floor: NDArray[np.float64]
) -> NDArray[np.float64]:
    """1 - (after^2 - floor^2) / (before^2 - floor^2), from the squares; NaN where there was nothing to close."""
    whole = before - floor
    share = 1.0 - np.maximum(after - floor, 0.0) / np.where(whole > 0.0, whole, 1.0)
    return np.where(whole > 0.0, np.minimum(share, 1.0), np.nan)


SAMPLES = 256
"""Instants of a cycle."""

REVERSAL, MID_STROKE = 0.3, 0.8
"""Shares of the largest velocity below which the plant turns round and above which it is in mid-stroke."""

DIFFERENTIATIONS = {"m/s^2": -1, "rad/s^2": -1, "m/s": 0, "rad/s": 0, "m": 1, "rad": 1}
"""How many times a channel of a unit is differentiated to be a velocity."""


def gap_map(problem: "DwellProblem", data: Data, rows: NDArray[np.float64]) -> tuple[MapCell, ...]:
    """The gap of every harmonic that is compared.

    ``rows`` (m,) are those that a model predicts [unit of the reading].
    """
    shape = problem.shape
    measured = problem.likelihood.harmonics(data.measured[None], shape)[0]
    residual = problem.likelihood.harmonics((data.measured - rows)[None], shape)[0]
    squares = np.zeros(2 * int(np.prod(shape)))
    squares[problem.likelihood.place] = (data.measured - rows) ** 2 / data.variance
    sigma = np.sqrt(squares.reshape(*shape, 2).mean(axis=-1))
    frequency = np.asarray(problem.excitation.frequency)
    cells = []
    for d, c, k in np.argwhere(sigma > 0.0):
        size = np.abs(measured[d, c, 1]) or np.abs(measured[d, c]).max()
        percent = 100.0 * np.abs(residual[d, c, k]) / size
        cells.append(
            MapCell(problem.channels[c], float(frequency[d]), int(k), float(percent), float(sigma[d, c, k]))
        )
    return tuple(cells)


def cycle_positions(
    problem: "DwellProblem", data: Data, rows: NDArray[np.float64]
) -> tuple[CyclePosition, ...]:
    """The gap of the waveforms at reversal, in mid-stroke and between, by channel; every test counts alike.

    The cycle is that of the velocity which the plant's first channel shows; without that channel there is none.
    ``rows`` (m,) are those that a model predicts [unit of the reading].
    """
    shape, first = problem.shape, problem.plant.channels[0]
    measured = problem.likelihood.harmonics(data.measured[None], shape)[0]
    residual = problem.likelihood.harmonics((data.measured - rows)[None], shape)[0]
    if first.unit not in DIFFERENTIATIONS or not np.any(measured[:, 0]):
        return ()
    phase = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    order = np.arange(shape[2])
    turns = np.exp(1j * order[:, None] * phase)
    velocity = np.real((measured[:, 0, 1:] * (1j * order[1:]) ** DIFFERENTIATIONS[first.unit]) @ turns[1:])
    fastest = np.abs(velocity).max(axis=1, keepdims=True)
    speed = np.abs(velocity) / np.where(fastest > 0.0, fastest, 1.0)
    found = []
    for c, channel in enumerate(problem.channels):
        power = np.sum(np.abs(measured[:, c]) ** 2, axis=1)
        if not np.any(power):
            continue
        wave = np.real(residual[:, c] @ turns) ** 2 / np.where(power > 0.0, power, np.inf)[:, None]
        whole = wave.sum()
        at_reversal, at_middle = wave[speed < REVERSAL].sum() / whole, wave[speed > MID_STROKE].sum() / whole
        between = 1.0 - at_reversal - at_middle
        found.append(CyclePosition(channel, float(at_reversal), float(at_middle), float(between)))
    return tuple(found)
