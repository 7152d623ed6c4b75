"""The channels of a test at even instants, all at the same, as a window of it is cut."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.recording import Recording
from savgs_ident.responses.resolution import roughness

Array = NDArray[np.float64]

LONGEST_GAP = 5.0
"""Samples that may lack one after the other, in mean intervals, where a curve through the others stands in."""

REST_S = 0.2
"""As long as this a test has to rest at its beginning to be taken for one that rested before [s]."""

RESTING = 1e-3
"""Range that a channel may have at rest, over that in the whole test, where its noise is not larger [1]."""

LEAST_SAMPLES = 2.5
"""Samples in a period of the highest frequency that is compared, at least."""

DECAY_LEAST = 0.25
"""A decay may be that much shorter than other tests [1]: it is compared from its first sample on."""

_RATE_HZ = 1000.0
_FEWEST = 10
_NOISY = 8.0


@dataclass(frozen=True)
class EvenRecord:
    """Channels of a test at even instants.

    Attributes:
        test: its name.
        start: the first instant on the clock of the recording [s].
        rate: instants a second [Hz].
        slowest: samples a second of the channel with the fewest [Hz].
        values: of each channel by its name [its unit], (n,).
        gaps: spans without samples of each channel [s], pairs of their ends.
        noise: standard deviation of each channel's noise at one instant [its unit], which neighbours share where the
            channel has fewer samples than there are instants; the amplitudes have as much of it as if they did not.
        rest: at its beginning it has to rest so long to be taken for one that rested before [s].
        decays: whether nothing drives the plant in it, which was set in motion before.
        before: how much of it is rest before the test began [s].
    """

    test: str
    start: float
    rate: float
    slowest: float
    values: dict[str, Array]
    gaps: dict[str, list[tuple[float, float]]]
    noise: dict[str, float]
    rest: float
    decays: bool = False
    before: float = 0.0

    @property
    def count(self) -> int:
        """How many instants there are."""
        return next(iter(self.values.values())).size

    @property
    def duration(self) -> float:
        """[s]."""
        return self.count / self.rate

    @property
    def begins_at_rest(self) -> bool:
        """Whether no channel shows anything but noise at the beginning, and the plant was not held there."""
        if self.decays:
            return False
        beginning = ceil(self.rest * self.rate)
        return all(
            np.ptp(each[:beginning]) <= max(RESTING * np.ptp(each), _NOISY * self.noise[name])
            for name, each in self.values.items()
        )

    def rested(self, seconds: float) -> "EvenRecord":
        """The same with so much rest before it [s], as it began."""
        beginning, count = ceil(self.rest * self.rate), ceil(seconds * self.rate)
        before = count / self.rate
        return replace(
            self,
            start=self.start - before,
            values={
                name: np.concatenate([np.full(count, np.mean(each[:beginning])), each])
                for name, each in self.values.items()
            },
            gaps={name: [(a + before, b + before) for a, b in each] for name, each in self.gaps.items()},
            before=before,
        )


def even_record(
    source: str,
    recording: Recording,
    inputs: Sequence[str],
    names: Collection[str],
    still: dict[str, float],
    least_s: float,
    highest_hz: float,
    time_scale: float,
) -> EvenRecord | DataWarning:
    """The channels of a test at even instants, or why it cannot be used.

    It has to be ``least_s`` [s] long, a decay a quarter of that, and its channels sampled for what is compared up to
    ``highest_hz`` [Hz]; the first of the ``inputs`` has to move, but for a decay. ``still`` is the noise of channels
    at rest, where it is known; ``time_scale`` that of the plant [1].
    """
    driven = inputs[0]

    def refuse(what: str, remedy: str) -> DataWarning:
        return DataWarning("window_not_used", what, source, recording.name, driven, None, remedy)

    usable = {}
    for name in names:
        channel = recording.channels.get(name)
        known = None if channel is None else np.isfinite(channel.values)
        if channel is not None and known is not None and np.count_nonzero(known) >= _FEWEST:
            time, first = np.unique(channel.time[known], return_index=True)
            usable[name] = time, channel.values[known][first]
    decays = recording.kind == "decay" and bool(usable)
    if driven not in usable and not decays:
        return refuse(f"{driven} was not recorded", "map its channel, or leave this test out")
    if not decays and np.ptp(usable[driven][1]) == 0.0:
        return refuse(
            f"{driven} does not move",
            "name this test a standstill, or a decay if it shows how the plant comes to rest",
        )
    start = max(time[0] for time, _ in usable.values())
    end = min(time[-1] for time, _ in usable.values())
    if end - start < least_s * (DECAY_LEAST if decays else 1.0):
        return refuse(
            f"its channels overlap for {max(end - start, 0.0):.2g} s", "look at the clocks of the channels"
        )
    rates = {name: (time.size - 1) / (time[-1] - time[0]) for name, (time, _) in usable.items()}
    last = min(rates, key=lambda name: rates[name])
    if rates[last] < LEAST_SAMPLES * highest_hz:
        return refuse(
            f"{last} is sampled at {rates[last]:.3g} Hz, too slow for what is compared up to {highest_hz:g} Hz",
            f"sample every channel at {4.0 * highest_hz:g} Hz or faster",
        )
    rate = min(max(rates.values()), _RATE_HZ / time_scale)
    instants = start + np.arange(floor((end - start) * rate) + 1) / rate
    even = {name: _at(instants, *each) for name, each in usable.items()}
    if decays:
        even |= {name: _resting(even.get(name), instants) for name in inputs}
    noise = {
        name: (still.get(name) or roughness(values))
        * max(1.0, rate * (time[-1] - time[0]) / time.size) ** 0.5
        for name, (time, values) in usable.items()
    }
    gaps = {name: _gaps(each[0], start) for name, each in usable.items()}
    lacking = set(even) - set(usable)
    noise |= dict.fromkeys(lacking, 0.0)
    gaps |= {name: [] for name in lacking}
    found = EvenRecord(
        recording.name, start, rate, rates[last], even, gaps, noise, REST_S * time_scale, decays
    )
    return _let_go(found) if decays else found


def _let_go(held: EvenRecord) -> EvenRecord:
    """A decay from where the plant is let go: before that something holds it which nobody recorded."""
    moves = [
        np.abs(each - each[0]) > max(RESTING * np.ptp(each), _NOISY * held.noise[name])
        for name, each in held.values.items()
    ]
    first = int(np.argmax(np.any(moves, axis=0)))
    before = first / held.rate
    if before < held.rest:
        return held
    return replace(
        held,
        start=held.start + before,
        values={name: each[first:] for name, each in held.values.items()},
        gaps={name: [(a - before, b - before) for a, b in each] for name, each in held.gaps.items()},
    )


def _resting(recorded: Array | None, instants: Array) -> Array:
    """An input of a decay, at its mean: what it shows is noise. Of one that was not recorded that is zero."""
    return np.full(instants.size, 0.0 if recorded is None else np.mean(recorded))


def _at(instants: Array, time: Array, values: Array) -> Array:
    """A channel at other instants [s]; as it was sampled where these are its own."""
    if time.size == instants.size and np.max(np.abs(time - instants)) < 1e-3 * (instants[1] - instants[0]):
        return values
    # Takes a second to import, which campaigns of dwells would wait for.
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(time, values)(instants))


def _gaps(time: Array, start: float) -> list[tuple[float, float]]:
    """Spans in which samples lack [s after ``start``]."""
    step = np.diff(time)
    long = np.flatnonzero(step > LONGEST_GAP * np.median(step))
    return [(float(time[place] - start), float(time[place + 1] - start)) for place in long]
