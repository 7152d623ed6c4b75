"""Checks of one channel within a test: its time stamps, its values, the end of its range.

Time stamps are used as they are, so jitter is harmless. A clock that runs backwards was set, or the file was
pasted together; the right samples are then unknown, which is an error. A few repeated stamps are dropped. A
jump loses samples; a harmonic estimate tolerates this up to a tenth of the record (about one of at least
eight periods).

The bounds on values are those of the layout, with a wide margin. They detect a wrong unit (27.5 mm read
as 27.5 m) and do not assess a measurement. A few samples beyond them are left out; other spikes are for the response
to find, which knows the waveform. A check of the size of a signal does not look at its largest samples
(:func:`ordinary_samples`).

A clipped sensor repeats one extreme value, in run after run, far more often than the value next to it. A
quantised sinusoid also dwells at its turning points, but the outermost of its levels holds at most
acos(1 - e) / (acos(1 - 2 e) - acos(1 - e)) -> 2.4 times the samples of the next one (e = quantum over
amplitude, small). The end of a range is the same in every test: a value that another test exceeds is not one.
A signal with noise added after the clipping is not recognised.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import SLOWEST_HZ, ChannelSpec, RecordedChannel, Recording


@dataclass(frozen=True)
class DataLocation:
    """Where in the data a check is looking: the source, the test and the channel that its findings name."""

    source: str
    test: str = ""
    channel: str = ""

    def error(self, what: str, remedy: str, time: float | None = None) -> InputError:
        """An error at this place, at ``time`` [s] if it has one."""
        return InputError(
            what, source=self.source, test=self.test, channel=self.channel, time=time, remedy=remedy
        )

    def warning(self, code: str, what: str, remedy: str, time: float | None = None) -> DataWarning:
        """A warning at this place, at ``time`` [s] if it has one."""
        return DataWarning(code, what, self.source, self.test, self.channel, time, remedy)


LONGEST_GAP = 0.10
"""How long a gap may be, as a fraction of the record, in a test that a response is made of."""
_JUMP_STEPS = 5.0
"""A step this many times the median one is a jump: two lost samples in a row are still jitter of a bus."""
_MOST_REPEATED = 0.10
_FASTEST_HZ = 200e3
_LONGEST_S = 1e9
"""Thirty years: no test."""
_FILL = "fill the time column, and check its unit"
_MIND_UNIT = "check the unit of the time column (s, ms or us)"


def check_stamps(channel: RecordedChannel, place: DataLocation) -> None:
    """Raises :class:`InputError` where a sample has no time, or one that is none."""
    bad = np.flatnonzero(~(np.abs(channel.time) <= _LONGEST_S))
    if bad.size:
        raise place.error(f"the time stamp of sample {bad[0] + 1} is missing or no time", _FILL)


def check_time(
    channel: RecordedChannel,
    place: DataLocation,
    longest_gap: float = LONGEST_GAP,
    slowest_hz: float = SLOWEST_HZ,
) -> tuple[RecordedChannel, tuple[DataWarning, ...]]:
    """The channel with repeated stamps removed, and warnings.

    ``longest_gap`` is how long a gap may be, as a share of the record; ``slowest_hz`` a logger's lowest rate [Hz].
    Raises :class:`InputError` for stamps that run backwards, are mostly repeated, or have a rate that no
    logger has.
    """
    time = channel.time
    if time.size < 2:
        raise place.error("has fewer than two samples", "record again")
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    if back.size:
        at = int(back[0])
        raise place.error(
            f"time runs backwards by {-steps[at]:.6g} s",
            "the clock was set, or files were pasted together: split the file there",
            time=float(time[at]),
        )
    channel, warnings = _without_repeats(channel, place)
    median = float(np.median(np.diff(channel.time)))
    if not 1.0 / _FASTEST_HZ <= median <= 1.0 / slowest_hz:
        raise place.error(f"samples are {median:.3g} s apart, which no data logger does", _MIND_UNIT)
    return channel, (*warnings, *_jumps(channel, median, longest_gap, place))


def _without_repeats(
    channel: RecordedChannel, place: DataLocation
) -> tuple[RecordedChannel, tuple[DataWarning, ...]]:
    repeated = np.diff(channel.time, prepend=-np.inf) == 0.0
    count = int(np.count_nonzero(repeated))
    if count == 0:
        return channel, ()
    at = float(channel.time[np.argmax(repeated)])
    if count > _MOST_REPEATED * repeated.size:
        raise place.error(
            f"{count} of {repeated.size} samples repeat the time stamp before them",
            "log the time with more digits",
            time=at,
        )
    kept = replace(channel, time=channel.time[~repeated], values=channel.values[~repeated])
    return kept, (
        place.warning(
            "repeated_time",
            f"{count} samples repeat the time stamp before them, left out",
            "log the time with more digits",
            time=at,
        ),
    )


def _jumps(
    channel: RecordedChannel, median: float, longest_gap: float, place: DataLocation
) -> tuple[DataWarning, ...]:
    steps = np.diff(channel.time)
    jumps = np.flatnonzero(steps > _JUMP_STEPS * median)
    if jumps.size == 0:
        return ()
    worst = int(np.argmax(steps))
    length = float(channel.time[-1] - channel.time[0])
    what = f"time jumps by {steps[worst]:.4g} s ({jumps.size} such gaps), samples come every {median:.4g} s"
    if steps[worst] > longest_gap * length:
        raise place.error(what, "record the test again without the gap", time=float(channel.time[worst]))
    return (
        place.warning("time_jump", what, "check the logger for lost samples", float(channel.time[worst])),
    )


_MOST_MISSING = 0.20
_REGULAR = 1.5


def check_missing(
    channel: RecordedChannel, place: DataLocation, longest_gap: float = LONGEST_GAP
) -> tuple[RecordedChannel | None, tuple[DataWarning, ...]]:
    """The channel without its missing samples; None where there is nothing else.

    Regularly missing samples are those of a slower sensor in a faster table, and no fault. Raises
    :class:`InputError` where more is missing than an estimate tolerates.
    ``longest_gap`` is how long a gap may be, as a share of the record.
    """
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


_LARGEST_NUMBER = 1e100
"""Larger numbers are not measured in any unit, and their squares overflow."""
_TYPICAL_SHARE, _TYPICAL_MOST = 0.95, 0.5
"""So many of the samples are no larger than this share of what is possible, or the others are no spikes."""


def check_possible(
    channel: RecordedChannel, spec: ChannelSpec, place: DataLocation
) -> tuple[RecordedChannel, tuple[DataWarning, ...]]:
    """The channel without the samples that no rig of this kind gives: larger than any, or infinite.

    Raises :class:`InputError` where most samples are large, too: then they are no spikes but in another unit.
    """
    size, largest = np.abs(channel.values), min(spec.largest, _LARGEST_NUMBER)
    impossible = size > largest
    count = int(np.count_nonzero(impossible))
    if count == 0:
        return channel, ()
    first = float(channel.time[np.argmax(impossible)])
    typical = float(np.quantile(size, _TYPICAL_SHARE, method="higher"))
    if np.isinf(typical):
        infinite = np.count_nonzero(np.isinf(size))
        raise place.error(f"{infinite} of {size.size} values are infinite", "mend the export", time=first)
    what = f"{count} of {size.size} samples are not possible (up to {np.max(size):.4g} {spec.unit})"
    if typical > _TYPICAL_MOST * largest:
        remedy = "put the right unit into the header or channels.toml"
        raise place.error(f"{what}, the data may be in {spec.suspect}", remedy, time=first)
    kept = replace(channel, time=channel.time[~impossible], values=channel.values[~impossible])
    remedy = "check the sensor's cable and the logger"
    return kept, (place.warning("impossible_samples", f"{what}, left out", remedy, time=first),)


_TAIL = 0.02


def ordinary_samples(channel: RecordedChannel) -> RecordedChannel:
    """The channel without its gross spikes, for a check of its size.

    These exceed the range of 96 % of the samples by more than its width; there are none where it is a single value.
    """
    if channel.values.size == 0:
        return channel
    low, high = np.quantile(channel.values, (_TAIL, 1.0 - _TAIL))
    width = high - low
    gross = (channel.values < low - width) | (channel.values > high + width)
    if width == 0.0 or not np.any(gross):
        return channel
    return replace(channel, time=channel.time[~gross], values=channel.values[~gross])


def find_longest_constant(channel: RecordedChannel) -> tuple[float, float]:
    """Length [s] and start [s] of the longest run of one and the same value."""
    edges = np.flatnonzero(np.diff(channel.values)) + 1
    starts = np.concatenate([[0], edges])
    stops = np.concatenate([edges, [channel.values.size]]) - 1
    lengths = channel.time[stops] - channel.time[starts]
    longest = int(np.argmax(lengths))
    return float(lengths[longest]), float(channel.time[starts[longest]])


_LEAST_RUN, _LEAST_RUNS, _LEAST_SHARE, _RATIO = 3, 3, 0.01, 5.0


@dataclass(frozen=True)
class _Clip:
    test: str
    share: float
    time: float


def check_clipping(recordings: Sequence[Recording], source: str) -> tuple[DataWarning, ...]:
    """A warning ``clipped_sensor`` for every channel and side where a sensor ran into its end."""
    warnings = []
    for name in sorted({name for recording in recordings for name in recording.channels}):
        having = [
            (recording, ordinary_samples(recording.channels[name]))
            for recording in recordings
            if name in recording.channels
        ]
        for sign, side in ((1.0, "upper"), (-1.0, "lower")):
            end = max(float(np.max(sign * channel.values)) for _, channel in having)
            clips = [clip for test, channel in having if (clip := _clip(test, channel, sign, end))]
            if clips:
                worst = max(clips, key=lambda clip: clip.share)
                warnings.append(
                    DataLocation(source, worst.test, name).warning(
                        "clipped_sensor",
                        f"{100 * worst.share:.1f} % of the samples stand at the {side} end {sign * end:.6g}"
                        f" ({len(clips)} tests reach it)",
                        "use a larger range, or leave these tests out; a signal that is meant to hold there,"
                        " as steps do, may be right",
                        time=worst.time,
                    )
                )
    return tuple(warnings)


def _clip(recording: Recording, channel: RecordedChannel, sign: float, end: float) -> _Clip | None:
    values = sign * channel.values
    if recording.kind == "standstill" or values.size == 0 or values.max() < end:
        return None
    at_end = values == end
    count = int(np.count_nonzero(at_end))
    if count < _LEAST_SHARE * values.size or _count_runs(at_end) < _LEAST_RUNS:
        return None
    below = values[~at_end]
    if below.size == 0:
        return None
    beside = int(np.count_nonzero(below == below.max()))
    if count <= _RATIO * max(beside, 1):
        return None
    return _Clip(recording.name, count / values.size, float(channel.time[np.argmax(at_end)]))


def _count_runs(mask: NDArray[np.bool_]) -> int:
    """How many runs of True are at least ``_LEAST_RUN`` samples long."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return int(np.count_nonzero(edges[1::2] - edges[::2] >= _LEAST_RUN))
