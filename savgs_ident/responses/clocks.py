"""Channels of one dwell, grouped by the clock that stamped them, and how far each sampling carries.

A rate that differs between clocks shows in the data: the fundamental comes out different. A constant offset
between two clocks does not: it looks like a phase lag that grows with frequency, which is also what a
sensor's delay looks like. Stamps are therefore taken as true up to their rate.

A signal that was sampled without a filter folds what lies above the Nyquist frequency back into the band. A
periodic one folds onto lines of its own unless the sampling rate and the fundamental have a small common
multiple: orders k and l share a line where (k - l) f is a multiple of the rate, to within the resolution
1 / T. Up to that point orders above the Nyquist frequency can be fitted along, and are.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from savgs_ident.recordings.recording import Channel, Recording

_RESOLUTION = 0.7
_FARTHEST = 1000
_TRUSTED_SHARE = 0.40
_SAMPLES_PER_UNKNOWN = 3
_MOST_ORDERS = 400
_MOST_FOLDED = 150
_NYQUIST_SHARE = 0.45
_GAP = 1.5
_FEWEST_SAMPLES = 16


@dataclass(frozen=True)
class ClockGroup:
    """Channels that share their stamps: ``time`` [s], (N,), and ``values`` [unit], (C, N), all finite."""

    names: tuple[str, ...]
    time: NDArray[np.float64]
    values: NDArray[np.float64]

    @cached_property
    def rate_hz(self) -> float:
        """Sampling rate between gaps [Hz]."""
        intervals = np.diff(self.time)
        return float(1.0 / np.mean(intervals[intervals < _GAP * np.median(intervals)]))

    @cached_property
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
    """Orders of ``frequency`` [Hz] to fit: all that the stamps tell apart, with samples to spare."""
    by_line = (shared_line(group, frequency) - 1) // 2
    by_count = (group.time.size // _SAMPLES_PER_UNKNOWN - 2) // 2
    by_use = max(int(_NYQUIST_SHARE * group.rate_hz / frequency), _MOST_FOLDED)
    return max(min(by_line, by_count, by_use, _MOST_ORDERS), 0)


def shared_line(group: ClockGroup, frequency: float) -> int:
    """The smallest difference of two orders that fall on one line of the record, given the sampling.

    ``frequency`` [Hz] is their fundamental.
    """
    difference = np.arange(1, max(_FARTHEST, int(2.0 * group.rate_hz / frequency)))
    folds = difference * frequency / group.rate_hz
    apart = np.abs(folds - np.round(folds)) * group.rate_hz * group.span_s
    shared = np.flatnonzero(apart < _RESOLUTION)
    return int(difference[shared[0]]) if shared.size else int(difference[-1])


def highest_valid_order(group: ClockGroup, frequency: float, orders: int) -> int:
    """The highest order of ``frequency`` [Hz] up to ``orders`` well below the Nyquist frequency.

    -1 if not even 1 is.
    """
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
