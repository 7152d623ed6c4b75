"""The gap in per cent of the response: relative rms over tests, channels pooled by their own signal power."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.result import Shrink
from savgs_ident.model.sensors import RESPONSE_CHANNELS

RESAMPLES = 500
"""Campaigns drawn by resampling the tests."""

SEED = 7


@dataclass(frozen=True)
class Rows:
    """Rows of the three models, (m,) each, and the channel of each row, an index of RESPONSE_CHANNELS.

    Rows are in the unit of their reading.
    """

    before: NDArray[np.float64]
    recalibrated: NDArray[np.float64]
    after: NDArray[np.float64]
    channel: NDArray[np.intp]


def shrinks(data: Data, rows: Rows) -> tuple[Shrink, dict[str, Shrink]]:
    """The gap of both channels together, and of each."""
    power = _by_test(data, rows, data.measured**2)
    squares = {
        "before": _by_test(data, rows, (data.measured - rows.before) ** 2),
        "recalibrated": _by_test(data, rows, (data.measured - rows.recalibrated) ** 2),
        "after": _by_test(data, rows, (data.measured - rows.after) ** 2),
        "floor": _by_test(data, rows, data.variance),
    }
    present = [c for c in range(len(RESPONSE_CHANNELS)) if np.any(rows.channel == c)]
    together = _shrink(squares, power, present)
    return together, {RESPONSE_CHANNELS[c]: _shrink(squares, power, [c]) for c in present}


def _by_test(data: Data, rows: Rows, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums by test and channel, (t, 2)."""
    out = np.zeros((data.tests, len(RESPONSE_CHANNELS)))
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
    squares: dict[str, NDArray[np.float64]], power: NDArray[np.float64], channels: list[int]
) -> Shrink:
    whole = {name: float(_relative(square, power, channels)) for name, square in squares.items()}
    tests = np.random.default_rng(SEED).integers(0, len(power), (RESAMPLES, len(power)))
    drawn = {name: _relative(square[tests], power[tests], channels) for name, square in squares.items()}
    closed = _closed(drawn["before"], drawn["after"], drawn["floor"])
    low, high = np.nanquantile(closed, [0.025, 0.975]) if np.isfinite(closed).any() else (np.nan, np.nan)
    return Shrink(
        **{name: float(np.sqrt(value)) for name, value in whole.items()},
        share_closed=float(_closed(*(np.array(whole[name]) for name in ("before", "after", "floor")))),
        interval=(float(low), float(high)),
    )


def _closed(
    before: NDArray[np.float64], after: NDArray[np.float64], floor: NDArray[np.float64]
) -> NDArray[np.float64]:
    """1 - (after^2 - floor^2) / (before^2 - floor^2), from the squares; NaN where there was nothing to close."""
    whole = before - floor
    share = 1.0 - np.maximum(after - floor, 0.0) / np.where(whole > 0.0, whole, 1.0)
    return np.where(whole > 0.0, np.minimum(share, 1.0), np.nan)
