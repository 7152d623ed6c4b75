"""The channels of a test at even instants, all at the same, as a window of it is cut."""

from collections.abc import Collection, Mapping, Sequence
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

SOON = 0.1
"""A release before this share of the time that a plant has to rest is the beginning of the test [1]."""

_RATE_HZ = 1000.0
_FEWEST = 10
_NOISY = 8.0
_MOVES = 3.0
_SAME = 1e-9
_FEW = 4


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
        after: how long after the test began it begins [s].
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
    after: float = 0.0

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

    def refuse(what: str, remedy: str, channel: str = driven) -> DataWarning:
        return DataWarning("window_not_used", what, source, recording.name, channel, None, remedy)

    usable = {name: each for name in names if (each := _usable(recording, name)) is not None}
    rest = REST_S * time_scale
    if is_decay(recording, inputs):
        readings = {name: each for name, each in usable.items() if name not in inputs}
        if not readings:
            return refuse("no reading was recorded", "map a channel of the plant, or leave this test out")
        found = _evenly(readings, recording.name, still, rest, _RATE_HZ / time_scale)
        if found is None or found.slowest < LEAST_SAMPLES * highest_hz:
            return refuse(*_unfit(readings, highest_hz))
        released = _released(found, {name: usable[name] for name in inputs if name in usable})
        if released.duration < DECAY_LEAST * least_s:
            what = f"{released.duration:.2g} s of it are left once nothing holds the plant"
            return refuse(what, "record for longer after the release", next(iter(readings)))
        return released
    if driven not in usable:
        return refuse(f"{driven} was not recorded", "map its channel, or leave this test out")
    if np.ptp(usable[driven][1]) == 0.0:
        return refuse(
            f"{driven} does not move",
            "name this test a standstill, or a decay if it shows how the plant comes to rest",
        )
    found = _evenly(usable, recording.name, still, rest, _RATE_HZ / time_scale)
    if found is None or found.duration < least_s or found.slowest < LEAST_SAMPLES * highest_hz:
        return refuse(*_unfit(usable, highest_hz))
    return found


_Samples = tuple[Array, Array]
"""Instants [s] and values of a channel."""


def is_decay(recording: Recording, inputs: Sequence[str]) -> bool:
    """Whether nothing drives the plant in a test that is called a decay.

    A recorded input shows noise at its end, or a straight line, as a load cell that drifts.
    """
    if recording.kind != "decay":
        return False
    known = [each for name in inputs if (each := _usable(recording, name)) is not None]
    return not any(_moves(values[values.size // 2 :]) for _, values in known)


def _moves(values: Array) -> bool:
    """Whether evenly taken values (n,) show more than noise about a straight line."""
    place = np.linspace(-1.0, 1.0, values.size)
    about_line = values - place * (place @ values) / (place @ place)
    return bool(np.std(about_line) > max(_MOVES * roughness(values), _SAME * np.max(np.abs(values))))


def _usable(recording: Recording, name: str) -> _Samples | None:
    """The samples of a channel that are numbers, each instant once; None where there are next to none."""
    channel = recording.channels.get(name)
    if channel is None:
        return None
    known = np.isfinite(channel.values)
    time, first = np.unique(channel.time[known], return_index=True)
    return None if time.size < _FEWEST else (time, channel.values[known][first])


def _unfit(usable: Mapping[str, _Samples], highest_hz: float) -> tuple[str, str, str]:
    """Why channels cannot be compared up to a frequency [Hz], what to do, and which one is to blame."""
    lasting = min(time[-1] for time, _ in usable.values()) - max(time[0] for time, _ in usable.values())
    last = min(usable, key=lambda name: _rate(usable[name]))
    if _rate(usable[last]) >= LEAST_SAMPLES * highest_hz:
        what = f"its channels overlap for {max(lasting, 0.0):.2g} s"
        return what, "look at the clocks of the channels", next(iter(usable))
    what = f"{last} is sampled at {_rate(usable[last]):.3g} Hz, too slow for what is compared up to {highest_hz:g} Hz"
    return what, f"sample every channel at {4.0 * highest_hz:g} Hz or faster", last


def _rate(samples: _Samples) -> float:
    """Samples a second [Hz]."""
    time, _ = samples
    return float((time.size - 1) / (time[-1] - time[0]))


def _evenly(
    usable: Mapping[str, _Samples], test: str, still: dict[str, float], rest: float, most_hz: float
) -> EvenRecord | None:
    """Channels where they overlap, at the instants of the fastest of them; None where they do not."""
    start = max(time[0] for time, _ in usable.values())
    end = min(time[-1] for time, _ in usable.values())
    if end <= start:
        return None
    rates = {name: _rate(each) for name, each in usable.items()}
    rate = min(max(rates.values()), most_hz)
    instants = start + np.arange(floor((end - start) * rate) + 1) / rate
    if instants.size < _FEWEST:
        return None
    noise = {
        name: (still.get(name) or roughness(values))
        * max(1.0, rate * (time[-1] - time[0]) / time.size) ** 0.5
        for name, (time, values) in usable.items()
    }
    return EvenRecord(
        test,
        start,
        rate,
        min(rates.values()),
        {name: _at(instants, *each) for name, each in usable.items()},
        {name: _gaps(each[0], start) for name, each in usable.items()},
        noise,
        rest,
    )


def _released(held: EvenRecord, inputs: Mapping[str, _Samples]) -> EvenRecord:
    """A decay from where the plant is released: before that something holds it which nobody recorded.

    Its ``inputs`` are what they are in the mean from there on; those that were not recorded are not in it.
    """
    moves = np.zeros(held.count, bool)
    for name, each in held.values.items():
        away = np.abs(each - np.median(each[:_FEW]))
        out = away > max(RESTING * np.ptp(each), _NOISY * held.noise[name])
        # One sample alone is an outlier.
        moves[:-_FEW] |= np.lib.stride_tricks.sliding_window_view(out, _FEW + 1)[: held.count - _FEW].all(
            axis=1
        )
    first = int(np.argmax(moves))
    before = first / held.rate
    if before < SOON * held.rest:
        first, before = 0, 0.0
    values = {name: each[first:] for name, each in held.values.items()}
    count = held.count - first
    for name, (time, each) in inputs.items():
        later = each[time >= held.start + before]
        if later.size:
            values[name] = np.full(count, np.mean(later))
    return replace(
        held,
        start=held.start + before,
        values=values,
        gaps={name: [] for name in values}
        | {name: [(a - before, b - before) for a, b in each] for name, each in held.gaps.items()},
        noise=dict.fromkeys(values, 0.0) | held.noise,
        decays=True,
        after=before,
    )


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
