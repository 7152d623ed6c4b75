"""The gap between models and measurement in numbers: how large it is, and where in the response it lies.

Its size is a relative rms [1] over tests, channels pooled by their own signal power (:class:`Shrink`); its place is
given by channel, frequency and order (:class:`MapCell`), and by position in the cycle (:class:`CyclePosition`).
"""

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.inference.observations import Data

if TYPE_CHECKING:
    from savgs_ident.diagnosis.dwell_problem import DwellProblem


@dataclass(frozen=True)
class Shrink:
    """Relative rms gap [1] over held-out tests (0.1 is 10 %): before, recalibrated, after, and of the noise alone.

    ``share_closed`` is 1 - (after^2 - floor^2) / (before^2 - floor^2), ``interval`` its 95 % interval by
    resampling the tests. It counts what calibration closes, too; the two shares apart are below, and
    ``interval_by_effect`` is that of the second. All are NaN where there was nothing to close. ``scatter`` is the
    standard deviation [1] of floor^2 in as many rows, by chance.
    """

    before: float
    recalibrated: float
    after: float
    floor: float
    share_closed: float
    interval: tuple[float, float]
    interval_by_effect: tuple[float, float] = (nan, nan)
    scatter: float = 0.0

    @property
    def closed_by_calibration(self) -> float:
        """1 - (recalibrated^2 - floor^2) / (before^2 - floor^2) [1]."""
        return float(_closed(*np.square([self.before, self.recalibrated, self.floor])))

    @property
    def closed_by_effect(self) -> float:
        """1 - (after^2 - floor^2) / (recalibrated^2 - floor^2) [1]."""
        return float(_closed(*np.square([self.recalibrated, self.after, self.floor])))


@dataclass(frozen=True)
class FurtherShrink:
    """The same [1] of a recording that took no part: a sweep, another motion; NaN where nothing was computed.

    ``name`` says in a few words what was recorded.
    """

    name: str
    before: float
    recalibrated: float
    after: float
    floor: float


@dataclass(frozen=True)
class MapCell:
    """The gap of one harmonic, recalibrated baseline: in per cent of the channel's response and in noise sd."""

    channel: str
    frequency_hz: float
    order: int
    gap_percent: float
    gap_sigma: float


@dataclass(frozen=True)
class CyclePosition:
    """Where in the cycle of the body's velocity the gap of a channel lies, as shares of its square."""

    channel: str
    reversal: float
    mid_stroke: float
    between: float


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
        "floor": _by_test(data, rows, data.variance * data.left_by_nuisances),
    }
    scatter = _by_test(data, rows, 2.0 * data.variance**2 * data.left_by_nuisances)
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
    variances, powers = scatter[:, channels].sum(axis=0), power[:, channels].sum(axis=0)
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

DIFFERENTIATIONS = {"m/s^2": -1, "rad/s^2": -1, "m/s": 0, "rad/s": 0, "m": 1, "rad": 1}
"""How many times a channel of a unit is differentiated to be a velocity."""


def gap_map(problem: "DwellProblem", data: Data, rows: NDArray[np.float64]) -> tuple[MapCell, ...]:
    """The gap of every harmonic of the dwells that is compared.

    ``rows`` (m,) are those that a model predicts [unit of the reading].
    """
    shape = problem.shape
    measured = problem.likelihood.harmonics(data.measured[None], shape)[0]
    residual = problem.likelihood.harmonics((data.measured - rows)[None], shape)[0]
    squares = np.zeros(2 * int(np.prod(shape)))
    squares[problem.likelihood.place] = (data.measured - rows) ** 2 / data.variance
    sigma = np.sqrt(squares.reshape(*shape, 2).mean(axis=-1))
    sigma[problem.excitation.windows] = 0.0
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
    """The gap of the waveforms at reversal, in mid-stroke and between, by channel; every dwell counts alike.

    The cycle is that of the velocity which the plant's first channel shows; without that channel there is none.
    ``rows`` (m,) are those that a model predicts [unit of the reading].
    """
    shape, first = problem.shape, problem.plant.channels[0]
    constants = problem.constants
    measured = problem.likelihood.harmonics(data.measured[None], shape)[0][problem.dwells]
    residual = problem.likelihood.harmonics((data.measured - rows)[None], shape)[0][problem.dwells]
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
        found.append(cycle_position(channel, wave, speed, constants))
    return tuple(found)


def cycle_position(
    channel: str, squares: NDArray[np.float64], speed: NDArray[np.float64], constants: DecisionConstants
) -> CyclePosition:
    """Where in the cycle of a velocity the squares of a channel's gap lie.

    ``speed`` is the size of that velocity over the largest [1], of the shape of the ``squares``.
    """
    whole = squares.sum()
    at_reversal = float(squares[speed < constants.reversal_speed].sum() / whole)
    at_middle = float(squares[speed > constants.mid_stroke_speed].sum() / whole)
    return CyclePosition(channel, at_reversal, at_middle, 1.0 - at_reversal - at_middle)
