"""Tests that do not repeat, as a road or a sweep, cut into windows that a periodic solution follows.

    response = estimate_windows(campaign, inputs=("road_height",), readings=("sprung_accel", "susp_deflection"))

A rig forgets how a motion began. So each window begins some seconds before what is compared of it (:data:`LEAD_S`,
more for a plant that rings), and at its end its inputs are led over, in :data:`CLOSING_S`, to what they were before
it began. In such a window the inputs repeat, and the periodic motion that they lead to is the recorded one in what is
compared, wherever the recorded one came from: no state at the beginning has to be estimated. A test that
begins at rest is compared from its beginning, for before it the rig rested.

What is compared are complex amplitudes of the readings, weighted in time by a share that is zero outside that part
(:func:`savgs_ident.responses.harmonic_response.compared_share`), recorded and predicted alike:

    X_k = 2 / N sum_n m(t_n) x(t_n) exp(-2 pi i k t_n / T).

Noise of one sample, of variance s^2, has in each part of them the variance 2 s^2 / N^2 sum_n m(t_n)^2. Neighbours
share what they see of it, for the part that is compared is shorter than the window: every second is compared at most,
and every so many-th where there would be more than :data:`NUMBERS`.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import Campaign, Recording, TestKind
from savgs_ident.responses.driven_motion import roughness
from savgs_ident.responses.harmonic_response import ComparedPart, HarmonicResponse, compared_share
from savgs_ident.responses.outliers import estimate_standstill_noise

Array = NDArray[np.float64]

KINDS: tuple[TestKind, ...] = ("road", "sweep", "other")
"""The kinds of test that are cut into windows."""

LEAD_S = 3.0
"""From the beginning of a window to what is compared of it [s].

Origin: the body of a quarter car, at 1.3 Hz with a fifth of critical damping, has kept 0.7 % of what it began with,
the wheel nothing; friction shortens both.
"""

CLOSING_S = 0.5
"""Length in which the inputs are led over to where the window began [s]."""

COMPARED = 3.0
"""About how much of each window is compared, over its lead. Origin: computing time; more wastes less on the lead."""

LEAST_S = 2.0
"""Less than this is not worth a window [s]."""

LOWEST_HZ, HIGHEST_HZ = 0.4, 15.0
"""Between these is compared [Hz]: above body and wheel a model of two masses says nothing."""

IMPOSED_HZ = 80.0
"""Up to this the inputs are imposed [Hz], or as far as they are sampled: friction feels what no mass follows."""

NUMBERS = 1200
"""About how many numbers are compared. Origin: computing time; it rises with their cube where they share errors."""

LONGEST_GAP = 5.0
"""Samples that may lack one after the other, in mean intervals, where a curve through the others stands in."""

REST_S = 0.2
"""As long as this a test has to rest at its beginning to be taken for one that rested before [s]."""

RESTING = 1e-3
"""Range that a channel may have at rest, over that in the whole test, where its noise is not larger [1]."""

_RATE_HZ = 1000.0
_FEWEST = 10
_NOISY = 8.0


@dataclass(frozen=True)
class _Even:
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
        before: how much of it is rest before the test began [s].
    """

    test: str
    start: float
    rate: float
    slowest: float
    values: dict[str, Array]
    gaps: dict[str, list[tuple[float, float]]]
    noise: dict[str, float]
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
        """Whether no channel shows anything but noise at the beginning."""
        beginning = ceil(REST_S * self.rate)
        return all(
            np.ptp(each[:beginning]) <= max(RESTING * np.ptp(each), _NOISY * self.noise[name])
            for name, each in self.values.items()
        )

    def rested(self, seconds: float) -> "_Even":
        """The same with so much rest before it [s], as it began."""
        beginning, count = ceil(REST_S * self.rate), ceil(seconds * self.rate)
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


def estimate_windows(
    campaign: Campaign,
    inputs: Sequence[str],
    readings: Sequence[str],
    highest_hz: float = HIGHEST_HZ,
    lead_s: float = LEAD_S,
) -> HarmonicResponse:
    """The response of all tests of ``campaign`` that do not repeat, in windows.

    ``inputs`` are the channels that drive the plant, the first of which has to move; ``readings`` are what its
    sensors read. The noise is that of the standstill; where none was recorded, it is read from how rough the channels
    are. Up to ``highest_hz`` is compared [Hz], from ``lead_s`` [s] after the beginning of each window on.

    Raises :class:`InputError` where no test is long enough, the first input does not move, or nothing is compared.
    """
    if highest_hz < 2.0 * LOWEST_HZ:
        raise InputError(
            f"up to {highest_hz:g} Hz there is nothing to compare in windows",
            source="--max-frequency",
            remedy=f"they are compared from {LOWEST_HZ:g} Hz on",
        )
    still, warnings = estimate_standstill_noise(campaign)
    driven, found = inputs[0], []
    for recording in campaign.recordings:
        if recording.kind not in KINDS:
            continue
        even = _evenly(campaign.source, recording, driven, (*inputs, *readings), still)
        if isinstance(even, DataWarning):
            warnings += (even,)
        else:
            found.append(even.rested(lead_s + CLOSING_S) if even.begins_at_rest else even)
    cut = [(even, *span) for even in found for span in _spans(even.duration, lead_s)]
    if not cut:
        raise _no_window(campaign, found, warnings, lead_s)
    assumed = [name for name in readings if name not in still and any(name in each.values for each in found)]
    if assumed:
        warnings += (_noise_assumed(campaign.source, assumed),)
    windows = _Windows.of_one_length(cut, lead_s)
    channels = tuple(name for name in (*inputs, *readings) if any(name in each.values for each in found))
    return windows.response(channels, set(inputs), warnings, highest_hz)


def _evenly(
    source: str, recording: Recording, driven: str, names: Collection[str], still: dict[str, float]
) -> _Even | DataWarning:
    """The channels of a test at even instants, or why it cannot be used."""

    def refuse(what: str, remedy: str) -> DataWarning:
        return DataWarning("window_not_used", what, source, recording.name, driven, None, remedy)

    usable = {}
    for name in names:
        channel = recording.channels.get(name)
        known = None if channel is None else np.isfinite(channel.values)
        if channel is not None and known is not None and np.count_nonzero(known) >= _FEWEST:
            time, first = np.unique(channel.time[known], return_index=True)
            usable[name] = time, channel.values[known][first]
    if driven not in usable:
        return refuse(f"{driven} was not recorded", "map its channel, or leave this test out")
    if np.ptp(usable[driven][1]) == 0.0:
        return refuse(f"{driven} does not move", "name this test a standstill")
    start = max(time[0] for time, _ in usable.values())
    end = min(time[-1] for time, _ in usable.values())
    if end - start < LEAST_S:
        return refuse(
            f"its channels overlap for {max(end - start, 0.0):.2g} s", "look at the clocks of the channels"
        )
    rates = {name: (time.size - 1) / (time[-1] - time[0]) for name, (time, _) in usable.items()}
    last = min(rates, key=lambda name: rates[name])
    if rates[last] < 2.5 * HIGHEST_HZ:
        return refuse(
            f"{last} is sampled at {rates[last]:.3g} Hz, too slow for what is compared up to {HIGHEST_HZ:g} Hz",
            f"sample every channel at {4.0 * HIGHEST_HZ:g} Hz or faster",
        )
    rate = min(max(rates.values()), _RATE_HZ)
    instants = start + np.arange(floor((end - start) * rate) + 1) / rate
    even = {name: _at(instants, *each) for name, each in usable.items()}
    noise = {
        name: (still.get(name) or roughness(values))
        * max(1.0, rate * (time[-1] - time[0]) / time.size) ** 0.5
        for name, (time, values) in usable.items()
    }
    gaps = {name: _gaps(each[0], start) for name, each in usable.items()}
    return _Even(recording.name, start, rate, rates[last], even, gaps, noise)


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


def _spans(duration: float, lead: float) -> list[tuple[float, float]]:
    """Beginning and end of what is compared in each window of a test [s after its beginning]."""
    first, last = lead + CLOSING_S, duration
    if last - first < LEAST_S:
        return []
    count = max(1, round((last - first) / (COMPARED * lead)))
    edges = np.linspace(first, last, count + 1)
    return [(float(one), float(other)) for one, other in pairwise(edges)]


def _no_window(
    campaign: Campaign, found: list[_Even], warnings: tuple[DataWarning, ...], lead: float
) -> InputError:
    if found:
        longest = max(each.duration - each.before for each in found)
        least = lead + CLOSING_S + LEAST_S
        return InputError(
            f"the longest test has {longest:.3g} s, {least:.3g} s are needed",
            source=campaign.source,
            remedy="record a longer one, for the motion has to forget how it began; or one that begins at rest",
        )
    if not warnings:
        return InputError(
            "there is no test to compare with: neither a dwell nor a sweep or a road",
            source=campaign.source,
            remedy="name the dwells dwell_<f>Hz; a test with another name is taken as it is",
        )
    first = warnings[0]
    return InputError(
        f"no test can be used; the first: {first.what}",
        source=campaign.source,
        test=first.test,
        channel=first.channel,
        remedy=first.remedy,
    )


def _noise_assumed(source: str, names: Sequence[str]) -> DataWarning:
    return DataWarning(
        "noise_assumed",
        f"no standstill was recorded: the noise of {', '.join(names)} is read from how rough they are",
        source,
        "",
        names[0],
        None,
        "record some seconds at rest, and name that test standstill",
    )


@dataclass(frozen=True)
class _Window:
    """One window: the even record, and the place of its first instant in it."""

    record: _Even
    first: int


@dataclass(frozen=True)
class _Windows:
    """Windows of one length [s], of which the part between two phases [rad] is compared, after a lead [s]."""

    length: float
    lead: float
    part: tuple[float, float]
    windows: tuple[_Window, ...]

    @property
    def imposed_hz(self) -> float:
        """Up to which frequency the inputs are imposed [Hz]."""
        return min(IMPOSED_HZ, 0.45 * min(each.record.slowest for each in self.windows))

    @classmethod
    def of_one_length(cls, cut: Sequence[tuple[_Even, float, float]], lead: float) -> "_Windows":
        """The windows about what is compared, as long as the longest of them needs, with a ``lead`` [s]."""
        compared = max(end - begin for _, begin, end in cut)
        length = lead + compared + CLOSING_S
        part = 2.0 * np.pi * lead / length, 2.0 * np.pi * (lead + compared) / length
        windows = []
        for record, _, end in cut:
            last = min(round(end * record.rate), record.count - 1)
            first = last - round((lead + compared) * record.rate)
            windows.append(_Window(record, max(first, round(CLOSING_S * record.rate))))
        return cls(length, lead, part, tuple(windows))

    def response(
        self,
        channels: tuple[str, ...],
        inputs: set[str],
        warnings: tuple[DataWarning, ...],
        highest_hz: float,
    ) -> HarmonicResponse:
        """The complex amplitudes of all windows, up to a frequency [Hz]."""
        orders = floor(self.imposed_hz * self.length)
        shape = (len(self.windows), len(channels), orders + 1)
        harmonics, covariance = np.zeros(shape, np.complex128), np.zeros((*shape, 2, 2))
        valid, noise = np.zeros(shape, np.bool_), np.zeros(shape[:2])
        every, compared = self._compared(sum(name not in inputs for name in channels), highest_hz)
        for w, window in enumerate(self.windows):
            for c, name in enumerate(channels):
                if name not in window.record.values:
                    continue
                noise[w, c] = window.record.noise[name]
                signal, share = self._signal(window, name, name in inputs)
                step, kept = (1, valid[w, c] | True) if name in inputs else (every, compared)
                amplitudes, variance = self._amplitudes(signal, share, orders)
                picked = amplitudes[::step][: kept.size]
                harmonics[w, c, : picked.size] = picked
                covariance[w, c] = noise[w, c] ** 2 * variance * np.eye(2)
                valid[w, c, : kept.size] = kept & (not self._has_gap(window, name))
        return HarmonicResponse(
            tests=tuple(self._name(each) for each in self.windows),
            channels=channels,
            frequency=np.full(shape[0], 1.0 / self.length),
            frequency_sd=np.zeros(shape[0]),
            harmonics=harmonics,
            covariance=covariance,
            valid=valid,
            peak_to_peak=np.zeros(shape[:2]),
            peak_to_peak_sd=np.zeros(shape[:2]),
            noise_sd=noise,
            periods=np.ones(shape[0], np.int64),
            warnings=warnings,
            recorded=np.arange(float(shape[0])),
            part=ComparedPart(*(np.full(shape[0], float(each)) for each in (*self.part, every))),
        )

    def _name(self, window: _Window) -> str:
        # Rounded to what is printed, and no negative zero.
        begin = round(window.first / window.record.rate + self.lead - window.record.before, 1) + 0.0
        return f"{window.record.test}, {begin:.1f} to {begin + self.length - self.lead - CLOSING_S:.1f} s"

    def _compared(self, readings: int, highest_hz: float) -> tuple[int, NDArray[np.bool_]]:
        """From one order that is compared to the next, and which of them are, from 0 to the last."""
        last = floor(highest_hz * self.length)
        every = max(2, ceil(2 * len(self.windows) * readings * last / NUMBERS))
        return every, every * np.arange(last // every + 1) >= LOWEST_HZ * self.length

    def _signal(self, window: _Window, name: str, led_over: bool) -> tuple[Array, Array]:
        """A channel at the instants of a window [its unit], and the share with which each counts [1], (n,) both.

        An input is led over at the end to what it was before the beginning.
        """
        record = window.record
        count, values = round(self.length * record.rate), record.values[name]
        phase = np.asarray(2.0 * np.pi * np.arange(count) / (self.length * record.rate), np.float64)
        place = window.first + np.arange(count)
        here = values[np.minimum(place, values.size - 1)]
        if not led_over:
            return here, compared_share(phase, self.part[0], self.part[1])
        ahead = np.clip((phase - self.part[1]) / (2.0 * np.pi - self.part[1]), 0.0, 1.0)
        share = ahead**3 * (10.0 - 15.0 * ahead + 6.0 * ahead**2)
        before = values[np.maximum(place - count, 0)]
        return (1.0 - share) * here + share * before, np.ones(count)

    def _amplitudes(self, signal: Array, share: Array, orders: int) -> tuple[NDArray[np.complex128], float]:
        """Complex amplitudes (orders + 1,), and the variance of each part of them for noise of unit variance."""
        count = signal.size
        found = 2.0 / count * np.fft.rfft(share * signal)
        kept = np.zeros(orders + 1, np.complex128)
        upto = min(orders + 1, found.size)
        kept[:upto] = found[:upto]
        kept[0] = 0.5 * kept[0].real
        return kept, float(2.0 * np.sum(share**2)) / count**2

    def _has_gap(self, window: _Window, name: str) -> bool:
        begin = window.first / window.record.rate
        return any(end > begin and start < begin + self.length for start, end in window.record.gaps[name])
