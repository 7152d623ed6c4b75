"""Checks of a channel's values inside one test: missing, infinite, impossible, stuck.

The bounds of the possible are those of a rig of this size with a wide margin; they are there to catch a unit
(27.5 mm read as 27.5 m), not to judge a measurement.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.checks_time import LONGEST_GAP
from savgs_ident.recordings.place import Place
from savgs_ident.recordings.recording import CANONICAL_UNITS, Channel

LARGEST: Mapping[str, tuple[float, str]] = MappingProxyType(
    {
        "road_height": (0.5, "mm or cm"),
        "sprung_accel": (300.0, "mm/s^2, or a sensor in another unit than its header says"),
        "susp_deflection": (0.5, "mm or cm"),
        "link_angle": (20.0, "deg"),
        "link_velocity": (60.0, "rpm or deg/s"),
        "motor_current": (500.0, "mA"),
    }
)
"""Largest magnitude of each channel [SI] and what it is likely to be in instead."""

_MOST_MISSING = 0.20
_REGULAR = 1.5


def check_missing(
    channel: Channel, place: Place, longest_gap: float = LONGEST_GAP
) -> tuple[Channel | None, tuple[DataWarning, ...]]:
    """The channel without its missing samples; None where there is nothing else.

    Missing samples that come regularly are those of a slower sensor in a faster table, and no fault. Raises
    :class:`InputError` for infinite values, and where more is missing than the estimates stand.
    ``longest_gap`` is how long a gap may be, as a share of the record.
    """
    infinite = np.flatnonzero(np.isinf(channel.values))
    if infinite.size:
        raise place.error(
            f"{infinite.size} values are infinite", "mend the export", time=float(channel.time[infinite[0]])
        )
    missing = np.isnan(channel.values)
    count = int(np.count_nonzero(missing))
    if count == 0:
        return channel, ()
    first = float(channel.time[np.argmax(missing)])
    if count == missing.size:
        return None, (
            place.warning("empty_channel", "has no value in this test", "check the sensor's cable"),
        )
    kept = replace(channel, time=channel.time[~missing], values=channel.values[~missing])
    if _is_slower_sensor(kept.time, channel.time):
        return kept, ()
    gaps = np.diff(np.concatenate([channel.time[:1], kept.time, channel.time[-1:]]))
    length = float(channel.time[-1] - channel.time[0])
    if gaps.max() > longest_gap * length or count > _MOST_MISSING * missing.size:
        raise place.error(
            f"{count} of {missing.size} samples are missing, the longest gap is {gaps.max():.3g} s",
            "record the test again",
            time=first,
        )
    return kept, (
        place.warning(
            "missing_samples",
            f"{count} of {missing.size} samples are missing, left out; the longest gap is {gaps.max():.3g} s",
            "check the sensor's cable and the logger",
            time=first,
        ),
    )


def _is_slower_sensor(kept: NDArray[np.float64], grid: NDArray[np.float64]) -> bool:
    if kept.size < 3 or grid.size < 2 * kept.size - 1:
        return False
    steps = np.diff(kept)
    step = float(np.median(steps))
    inner = steps.max() <= _REGULAR * step and steps.min() >= step / _REGULAR
    return bool(inner and kept[0] - grid[0] <= _REGULAR * step and grid[-1] - kept[-1] <= _REGULAR * step)


def check_possible(channel: Channel, place: Place) -> None:
    """Raises :class:`InputError` where a value is larger than any rig of this kind gives."""
    bound, suspect = LARGEST[channel.name]
    worst = int(np.argmax(np.abs(channel.values)))
    value = float(channel.values[worst])
    if abs(value) > bound:
        raise place.error(
            f"{value:.4g} {CANONICAL_UNITS[channel.name]} is not possible, the data may be in {suspect}",
            "put the right unit into the header or channels.toml",
            time=float(channel.time[worst]),
        )


def longest_constant(channel: Channel) -> tuple[float, float]:
    """Length [s] and start [s] of the longest run of one and the same value."""
    edges = np.flatnonzero(np.diff(channel.values)) + 1
    starts = np.concatenate([[0], edges])
    stops = np.concatenate([edges, [channel.values.size]]) - 1
    lengths = channel.time[stops] - channel.time[starts]
    longest = int(np.argmax(lengths))
    return float(lengths[longest]), float(channel.time[starts[longest]])
