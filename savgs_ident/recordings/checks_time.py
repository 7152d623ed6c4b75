"""Checks of a channel's time stamps. Jitter is fine (the stamps are used as they are); disorder is not.

A clock that runs backwards has been set, or the file was pasted together: which samples are right cannot be
told, so that is an error. Repeated stamps are dropped if few. A jump loses samples, which a harmonic estimate
stands, as long as less than a tenth of the record (about one of at least eight periods) is lost.
"""

from dataclasses import replace

import numpy as np

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.place import Place
from savgs_ident.recordings.recording import Channel

LONGEST_GAP = 0.10
"""How long a gap may be, as a fraction of the record, in a test that a response is made of."""
_JUMP_STEPS = 5.0
"""A step this many times the median one is a jump: two lost samples in a row are still jitter of a bus."""
_MOST_REPEATED = 0.10
_SLOWEST_HZ, _FASTEST_HZ = 2.0, 200e3
_LONGEST_S = 1e9
"""Thirty years: no test."""
_FILL = "fill the time column, and check its unit"
_MIND_UNIT = "check the unit of the time column (s, ms or us)"


def check_stamps(channel: Channel, place: Place) -> None:
    """Raises :class:`InputError` where a sample has no time, or one that is none."""
    bad = np.flatnonzero(~(np.abs(channel.time) <= _LONGEST_S))
    if bad.size:
        raise place.error(f"the time stamp of sample {bad[0] + 1} is missing or no time", _FILL)


def check_time(
    channel: Channel, place: Place, longest_gap: float = LONGEST_GAP
) -> tuple[Channel, tuple[DataWarning, ...]]:
    """The channel with repeated stamps removed, and what there was to say.

    ``longest_gap`` is how long a gap may be, as a share of the record.
    Raises :class:`InputError` for stamps that run backwards, are mostly repeated, or whose rate no logger
    has.
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
    if not 1.0 / _FASTEST_HZ <= median <= 1.0 / _SLOWEST_HZ:
        raise place.error(f"samples are {median:.3g} s apart, which no data logger does", _MIND_UNIT)
    return channel, (*warnings, *_jumps(channel, median, longest_gap, place))


def _without_repeats(channel: Channel, place: Place) -> tuple[Channel, tuple[DataWarning, ...]]:
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


def _jumps(channel: Channel, median: float, longest_gap: float, place: Place) -> tuple[DataWarning, ...]:
    steps = np.diff(channel.time)
    jumps = np.flatnonzero(steps > _JUMP_STEPS * median)
    if jumps.size == 0:
        return ()
    worst = int(np.argmax(steps))
    length = float(channel.time[-1] - channel.time[0])
    told = f"time jumps by {steps[worst]:.4g} s ({jumps.size} such gaps), samples come every {median:.4g} s"
    if steps[worst] > longest_gap * length:
        raise place.error(told, "record the test again without the gap", time=float(channel.time[worst]))
    return (
        place.warning("time_jump", told, "check the logger for lost samples", float(channel.time[worst])),
    )
