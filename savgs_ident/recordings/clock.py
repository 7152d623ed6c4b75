"""Which clock of an MCAP topic tells when a sample was taken.

A message carries up to three times: the stamp in its header (set by the sensor's driver), the publish time
and the log time (set when the message reached the recorder). A sensor samples regularly, a network delivers
in bursts; so the clock whose increments are regular is the one to trust. Irregularity is the 10-90 % spread
of the increments over their median: about 0.1 for a jittered sensor, above 1 for bursts.
"""

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning

_BURSTY = 0.5
"""Irregularity above which a clock shows deliveries rather than samples."""
_JUDGED = 1 << 17
"""Samples by which a clock is judged: enough, and no more memory for a longer file."""
_MARGIN = 2.0
"""The header clock is left only for one that is this much more regular."""
_SAME_EPOCH_NS = 2_000_000_000
"""Header and log time further apart than this do not count from the same instant."""


@dataclass(frozen=True)
class ClockChoice:
    """The time of every sample [ns, on the scale of the log time], (n,), the clock's name, and what to tell."""

    time: NDArray[np.int64]
    name: str
    warnings: tuple[DataWarning, ...]


def irregularity(time: NDArray[np.int64]) -> float:
    """10-90 % spread of the increments of a clock (n,) over their median [1].

    Infinite where the clock stands still.
    """
    if time.size < 3:
        return inf
    low, middle, high = np.quantile(np.diff(time[:_JUDGED]), [0.1, 0.5, 0.9])
    return float((high - low) / middle) if middle > 0 else inf


def choose_clock(
    log: NDArray[np.int64],
    publish: NDArray[np.int64],
    header: NDArray[np.int64] | None,
    *,
    topic: str,
    source: str,
    forced: str | None = None,
) -> ClockChoice:
    """Judge the clocks of one topic, all of shape (n,) in [ns]; ``forced`` names one to take unjudged."""
    clocks = {"log": log} if publish is log else {"publish": publish, "log": log}
    if header is not None:
        clocks = {"header": header} | clocks
    spread = {name: irregularity(time) for name, time in clocks.items()}
    name = forced if forced in clocks else _most_trusted(spread)
    warnings = []
    if forced not in clocks and header is not None and max(spread.values()) > _BURSTY and log.size > 2:
        warnings.append(_told(name, spread, topic, source))
    time, moved = _on_log_scale(clocks[name], log)
    if moved:
        warnings.append(
            DataWarning(
                "clock_offset",
                f"the {name} clock differs from the log time by {moved * 1e-9:.3f} s, moved onto it",
                source=source,
                channel=topic,
                remedy="synchronise the sensor's clock with the recorder's",
            )
        )
    return ClockChoice(time, name, tuple(warnings))


def _most_trusted(spread: dict[str, float]) -> str:
    """The first of header, publish, log that no later one beats by the margin."""
    best = next(iter(spread))
    for name, value in spread.items():
        if spread[best] > _MARGIN * value and spread[best] > _BURSTY / _MARGIN:
            best = name
    return best


def _told(name: str, spread: dict[str, float], topic: str, source: str) -> DataWarning:
    shown = ", ".join(f"{clock} {value:.2f}" for clock, value in spread.items())
    return DataWarning(
        "clock_choice",
        f"its clocks disagree; the {name} clock is taken as the most regular (irregularity: {shown})",
        source=source,
        channel=topic,
        remedy='if another is right, set clock = "header", "log" or "publish" under [time] in channels.toml',
    )


def _on_log_scale(time: NDArray[np.int64], log: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """A clock of another epoch moved by the smallest delay seen; 0 where it has the same epoch."""
    delay = log - time
    if time is log or abs(int(np.median(delay))) < _SAME_EPOCH_NS:
        return time, 0
    offset = int(delay.min())
    return time + offset, offset
