"""Channels of one dwell, grouped by the clock that stamped them, and how far each sampling carries.

A rate that differs between clocks shows in the data: the fundamental comes out different. A constant offset
between two clocks does not: it looks like a phase lag that grows with frequency, which is also what a
sensor's delay looks like. Stamps are therefore taken as true up to their rate.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.recordings.recording import Channel, Recording

_FITTED_SHARE = 0.45
_TRUSTED_SHARE = 0.40
_SAMPLES_PER_UNKNOWN = 3
_MOST_ORDERS = 400
_FEWEST_SAMPLES = 16


@dataclass(frozen=True)
class ClockGroup:
    """Channels that share their stamps: ``time`` [s], (N,), and ``values`` [unit], (C, N), all finite."""

    names: tuple[str, ...]
    time: NDArray[np.float64]
    values: NDArray[np.float64]

    @property
    def rate_hz(self) -> float:
        """Sampling rate between gaps [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))

    @property
    def span_s(self) -> float:
        """Time that the samples stand for: one sampling interval longer than from first to last [s]."""
        return float((self.time[-1] - self.time[0]) + 1.0 / self.rate_hz)


def group_by_clock(
    recording: Recording, origin: float, stretch: Mapping[str, float]
) -> tuple[ClockGroup, ...]:
    """The channels of ``recording`` by clock, times counted from ``origin`` [s].

    Samples that are not finite are left out, and so are channels with fewer than 16 others. ``stretch``
    multiplies the time of a channel whose clock is known to run slow; 1 where it is not named.
    """
    found: list[tuple[NDArray[np.float64], float, list[Channel]]] = []
    for channel in recording.channels.values():
        factor = stretch.get(channel.name, 1.0)
        for time, other, members in found:
            if other == factor and _same(time, channel.time):
                members.append(channel)
                break
        else:
            found.append((channel.time, factor, [channel]))
    groups = []
    for time, factor, members in found:
        groups += _split_by_gaps(factor * (time - origin), members)
    return tuple(groups)


def highest_fitted_order(group: ClockGroup, frequency: float) -> int:
    """Orders to fit: most of what lies below the Nyquist frequency, with samples to spare."""
    by_rate = int(_FITTED_SHARE * group.rate_hz / frequency)
    by_count = (group.time.size // _SAMPLES_PER_UNKNOWN - 2) // 2
    return max(min(by_rate, by_count, _MOST_ORDERS), 0)


def highest_valid_order(group: ClockGroup, frequency: float, orders: int) -> int:
    """The highest order up to ``orders`` well below the Nyquist frequency; -1 if not even 1 is."""
    carried = min(int(_TRUSTED_SHARE * group.rate_hz / frequency), highest_fitted_order(group, frequency))
    return min(carried, orders) if carried >= 1 else -1


def _same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return one is other or np.array_equal(one, other)


def _split_by_gaps(time: NDArray[np.float64], members: list[Channel]) -> list[ClockGroup]:
    """One group for each pattern of usable samples."""
    patterns: dict[bytes, tuple[NDArray[np.bool_], list[Channel]]] = {}
    for channel in members:
        usable = np.isfinite(channel.values) & np.isfinite(time)
        patterns.setdefault(usable.tobytes(), (usable, []))[1].append(channel)
    return [
        ClockGroup(
            tuple(channel.name for channel in same),
            time[usable],
            np.stack([channel.values[usable] for channel in same]),
        )
        for usable, same in patterns.values()
        if np.count_nonzero(usable) >= _FEWEST_SAMPLES
    ]
