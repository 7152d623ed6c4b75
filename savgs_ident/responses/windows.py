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
from math import ceil, floor, log

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import Campaign, TestKind
from savgs_ident.responses.even_record import EvenRecord, even_record
from savgs_ident.responses.harmonic_response import ComparedPart, HarmonicResponse, compared_share
from savgs_ident.responses.outliers import estimate_standstill_noise
from savgs_ident.responses.selection import only_tests

Array = NDArray[np.float64]

KINDS: tuple[TestKind, ...] = ("road", "sweep", "other")
"""The kinds of test that are cut into windows."""

BESIDE_DWELLS: tuple[TestKind, ...] = ("road",)
"""Those of them that are where there are dwells: there a sweep is kept to see what is predicted of it."""

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
"""Between these is compared where nothing else is asked for [Hz]: above body and wheel a model of two masses says
nothing."""

IMPOSED_HZ = 80.0
"""Up to this the inputs are imposed [Hz], or as far as they are sampled: friction feels what no mass follows."""

MOST_HZ = 0.5 * IMPOSED_HZ
"""Up to this may be compared [Hz]: what the readings show there has to come from inputs that are imposed."""

NUMBERS = 1200
"""About how many numbers are compared. Origin: computing time; it rises with their cube where they share errors."""

_NEAR = 1.5


def estimate_windows(
    campaign: Campaign,
    inputs: Sequence[str],
    readings: Sequence[str],
    highest_hz: float = HIGHEST_HZ,
    lead_s: float = LEAD_S,
    kinds: Collection[TestKind] = KINDS,
) -> HarmonicResponse:
    """The response of all tests of ``campaign`` of these ``kinds``, which do not repeat, in windows.

    ``inputs`` are the channels that drive the plant, the first of which has to move; ``readings`` are what its
    sensors read. The noise is that of the standstill; where none was recorded, it is read from how rough the channels
    are. Up to ``highest_hz`` is compared [Hz], from ``lead_s`` [s] after the beginning of each window on.

    Raises :class:`InputError` where no test is long enough, the first input does not move, or nothing is compared.
    """
    if not 2.0 * LOWEST_HZ <= highest_hz <= MOST_HZ:
        raise InputError(
            f"windows cannot be compared up to {highest_hz:g} Hz",
            source="--max-frequency",
            remedy=f"choose it from {2.0 * LOWEST_HZ:g} to {MOST_HZ:g} Hz",
        )
    still, warnings = estimate_standstill_noise(campaign)
    driven, found = inputs[0], []
    for recording in campaign.recordings:
        if recording.kind not in kinds:
            continue
        even = even_record(
            campaign.source, recording, driven, (*inputs, *readings), still, LEAST_S, highest_hz
        )
        if isinstance(even, DataWarning):
            warnings += (even,)
        else:
            found.append(even.rested(lead_s + CLOSING_S) if even.begins_at_rest else even)
    first = lead_s + CLOSING_S
    compared = _compared_s([each.duration - first for each in found], COMPARED * lead_s)
    if compared == 0.0:
        raise _no_window(campaign, found, warnings, lead_s)
    warnings += tuple(
        _too_short(campaign.source, each, first + compared)
        for each in found
        if each.duration - first < compared
    )
    cut = [(even, end) for even in found for end in _ends(even.duration, first, compared)]
    assumed = [name for name in readings if name not in still and any(name in each.values for each in found)]
    if assumed:
        warnings += (_noise_assumed(campaign.source, assumed),)
    windows = _Windows.of(cut, lead_s, compared)
    channels = tuple(name for name in (*inputs, *readings) if any(name in each.values for each in found))
    response = replace(
        windows.response(channels, set(inputs), warnings, highest_hz),
        recorded=windows.recorded(campaign),
        beside=windows.beside(campaign),
    )
    return _with_readings(campaign.source, response, readings)


def _with_readings(source: str, response: HarmonicResponse, readings: Sequence[str]) -> HarmonicResponse:
    """The windows in which any reading is known all along, with a warning for each of the others."""
    places = [response.channel(name) for name in readings if name in response.channels]
    known = response.valid[:, places].any(axis=(1, 2))
    names, remedy = " or ".join(readings), "look at the sensors and their recording"
    if not known.any():
        raise InputError(f"no window has {names} without a gap", source=source, remedy=remedy)
    warnings = tuple(
        DataWarning(
            "window_not_used", f"has no {names} without a gap", source, response.tests[d], remedy=remedy
        )
        for d in np.flatnonzero(~known)
    )
    if not warnings:
        return response
    return replace(only_tests(response, np.flatnonzero(known)), warnings=(*response.warnings, *warnings))


def _compared_s(lasting: Sequence[float], wanted: float) -> float:
    """How much of every window is compared [s], where tests have so much that can be [s]; 0 where none has enough.

    Windows are of one length. It is one near ``wanted`` that leaves least uncompared, of several such the nearest;
    where all tests are shorter, of theirs.
    """
    longest = max(lasting, default=0.0)
    if longest < LEAST_S:
        return 0.0
    least = max(min(wanted / _NEAR, longest), LEAST_S)
    lengths = {
        each / count
        for each in lasting
        for count in range(1, ceil(each / least) + 1)
        if each >= count * least
    }
    near = [each for each in lengths if each <= wanted * _NEAR] or [min(lengths)]

    def worth(each: float) -> tuple[float, float]:
        return round(sum(each * _count(one, each) for one in lasting), 6), -abs(log(each / wanted))

    return max(near, key=worth)


def _count(lasting: float, compared: float) -> int:
    return floor(lasting / compared + 1e-9)


def _ends(duration: float, first: float, compared: float) -> list[float]:
    """Where what is compared in each window of a test ends [s after its beginning]."""
    return [duration - place * compared for place in reversed(range(_count(duration - first, compared)))]


def _too_short(source: str, even: EvenRecord, needed: float) -> DataWarning:
    return DataWarning(
        "window_not_used",
        f"has {even.duration - even.before:.3g} s, the windows of this campaign need {needed:.3g} s",
        source,
        even.test,
        remedy="give it as a campaign of its own, or record a longer one",
    )


def _no_window(
    campaign: Campaign, found: list[EvenRecord], warnings: tuple[DataWarning, ...], lead: float
) -> InputError:
    if found:
        longest = max(each.duration - each.before for each in found)
        least = lead + CLOSING_S + LEAST_S
        return InputError(
            f"the longest test has {longest:.3g} s, {least:.3g} s are needed",
            source=campaign.source,
            remedy="record a longer one, for the motion has to forget how it began; or one that begins at rest",
        )
    warnings = (*warnings, *campaign.left_out)
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

    record: EvenRecord
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
    def of(cls, cut: Sequence[tuple[EvenRecord, float]], lead: float, compared: float) -> "_Windows":
        """The windows of which so much is compared [s], up to an end [s], after a ``lead`` [s]."""
        length = lead + compared + CLOSING_S
        part = 2.0 * np.pi * lead / length, 2.0 * np.pi * (lead + compared) / length
        windows = []
        for record, end in cut:
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
            part=ComparedPart(*(np.full(shape[0], float(each)) for each in (*self.part, every))),
        )

    def recorded(self, campaign: Campaign) -> Array:
        """When what is compared in each window began, on the scale of when the tests did, (D,)."""
        return np.array([campaign.when(each.record.test, self._begin(each)) for each in self.windows])

    def beside(self, campaign: Campaign) -> dict[str, Array]:
        """Means of the free channels in what is compared of each window [their units], (D,) by name."""
        recordings = {each.name: each.channels for each in campaign.recordings}

        def mean(window: _Window, name: str) -> float:
            channel = recordings[window.record.test].get(name)
            if channel is None:
                return np.nan
            begin = window.record.start + window.first / window.record.rate + self.lead
            here = (channel.time >= begin) & (channel.time <= begin + self.length - self.lead - CLOSING_S)
            known = channel.values[here & np.isfinite(channel.values)]
            return float(known.mean()) if known.size else np.nan

        return {name: np.array([mean(each, name) for each in self.windows]) for name in campaign.layout.free}

    def _begin(self, window: _Window) -> float:
        """Where what is compared in a window begins [s after its test did]."""
        return window.first / window.record.rate + self.lead - window.record.before

    def _name(self, window: _Window) -> str:
        # Rounded to what is printed, and no negative zero.
        begin = round(self._begin(window), 1) + 0.0
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
