"""A sensor that has run into the end of its range.

The mark of a clipped sensor is that one extreme value comes back, in run after run, far more often than the
value next to it. A quantised sinusoid also dwells at its turning points, but there the outermost of its
levels holds at most acos(1 - e) / (acos(1 - 2 e) - acos(1 - e)) -> 2.4 times the samples of the next one (e =
quantum over amplitude, small). And the end of a range is the same in every test: a value that another test
exceeds is not one. A signal with noise added after the clipping is not recognised.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.place import Place
from savgs_ident.recordings.recording import Recording

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
        having = [recording for recording in recordings if name in recording.channels]
        for sign, side in ((1.0, "upper"), (-1.0, "lower")):
            end = max(float(np.max(sign * recording.channels[name].values)) for recording in having)
            clips = [clip for recording in having if (clip := _clip(recording, name, sign, end))]
            if clips:
                worst = max(clips, key=lambda clip: clip.share)
                warnings.append(
                    Place(source, worst.test, name).warning(
                        "clipped_sensor",
                        f"{100 * worst.share:.1f} % of the samples stand at the {side} end {sign * end:.6g}"
                        f" ({len(clips)} tests reach it)",
                        "use a larger range, or leave these tests out",
                        time=worst.time,
                    )
                )
    return tuple(warnings)


def _clip(recording: Recording, name: str, sign: float, end: float) -> _Clip | None:
    channel = recording.channels[name]
    values = sign * channel.values
    if recording.kind == "standstill" or values.size == 0 or values.max() < end:
        return None
    at_end = values == end
    count = int(np.count_nonzero(at_end))
    if count < _LEAST_SHARE * values.size or _runs_of(at_end) < _LEAST_RUNS:
        return None
    below = values[~at_end]
    if below.size == 0:
        return None
    beside = int(np.count_nonzero(below == below.max()))
    if count <= _RATIO * max(beside, 1):
        return None
    return _Clip(recording.name, count / values.size, float(channel.time[np.argmax(at_end)]))


def _runs_of(mask: NDArray[np.bool_]) -> int:
    """How many runs of True are at least ``_LEAST_RUN`` samples long."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return int(np.count_nonzero(edges[1::2] - edges[::2] >= _LEAST_RUN))
