"""What windows of tests show: complex amplitudes of the part that is compared.

A window leads up to that part, in which its inputs are as they were recorded, and is closed after it: in
:data:`CLOSING_S` its inputs are led over to what they were before it began, so that they repeat.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.even_record import EvenRecord
from savgs_ident.responses.harmonic_response import ComparedPart, HarmonicResponse, compared_share

Array = NDArray[np.float64]

CLOSING_S = 0.5
"""Length in which the inputs are led over to where the window began [s].

This and all other times and frequencies of windows are those of a plant whose time scale is 1
(:mod:`savgs_ident.plants.time_scale`).
"""

LOWEST_HZ, HIGHEST_HZ = 0.4, 15.0
"""Between these is compared where nothing else is asked for [Hz]: above body and wheel a model of two masses says
nothing."""

IMPOSED_HZ = 80.0
"""Up to this the inputs are imposed [Hz], or as far as they are sampled: friction feels what no mass follows."""

NUMBERS = 1200
"""About how many numbers are compared. Origin: computing time; it rises with their cube where they share errors."""


class Cut(NamedTuple):
    """What is compared in a window: so much [s] of a record, up to an ``end`` [s after its beginning].

    After a ``lead`` [s]; without one the window begins with its record, with a state that is to be estimated.
    """

    record: EvenRecord
    end: float
    compared: float
    lead: float


@dataclass(frozen=True)
class _Window:
    """One window: the even record, the place of its first instant in it, and how much of it is compared [s].

    That is after a ``lead`` [s].
    """

    record: EvenRecord
    first: int
    compared: float
    lead: float

    @property
    def begins_moving(self) -> bool:
        """Whether nothing leads up to what is compared."""
        return self.lead == 0.0

    @property
    def begins_at_rest(self) -> bool:
        """Whether the plant rested when it began."""
        return self.first < self.record.before * self.record.rate


@dataclass(frozen=True)
class Windows:
    """Windows of one length [s], of each of which a part is compared, of a plant with a time scale [1]."""

    length: float
    windows: tuple[_Window, ...]
    time_scale: float

    @property
    def imposed_hz(self) -> float:
        """Up to which frequency the inputs are imposed [Hz]."""
        return min(IMPOSED_HZ / self.time_scale, 0.45 * min(each.record.slowest for each in self.windows))

    @classmethod
    def of(cls, cut: Sequence[Cut], time_scale: float) -> "Windows":
        """The windows of what is cut."""
        closing = CLOSING_S * time_scale
        length = max(each.lead + each.compared for each in cut) + closing
        windows = []
        for record, end, compared, lead in cut:
            last = min(round(end * record.rate), record.count - 1)
            first = last - round((lead + compared) * record.rate)
            least = round(closing * record.rate) if lead else 0
            windows.append(_Window(record, max(first, least), compared, lead))
        return cls(length, tuple(windows), time_scale)

    def part(self, window: _Window) -> tuple[float, float]:
        """Between these phases a window is compared [rad]."""
        begin, end = window.lead, window.lead + window.compared
        return 2.0 * np.pi * begin / self.length, 2.0 * np.pi * end / self.length

    def response(
        self,
        channels: tuple[str, ...],
        inputs: Collection[str],
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
                alone = np.arange(kept.size) % self._apart(window, every) == 0 if name not in inputs else kept
                valid[w, c, : kept.size] = kept & alone & (not self._has_gap(window, name))
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
            part=ComparedPart(
                *np.array(
                    [
                        (*self.part(each), every, each.begins_at_rest, each.begins_moving)
                        for each in self.windows
                    ],
                    np.float64,
                ).T
            ),
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
            begin = window.record.start + window.first / window.record.rate + window.lead
            here = (channel.time >= begin) & (channel.time <= begin + window.compared)
            known = channel.values[here & np.isfinite(channel.values)]
            return float(known.mean()) if known.size else np.nan

        return {name: np.array([mean(each, name) for each in self.windows]) for name in campaign.layout.free}

    def _begin(self, window: _Window) -> float:
        """Where what is compared in a window begins [s after its test did]."""
        return window.first / window.record.rate + window.lead + window.record.after - window.record.before

    def _name(self, window: _Window) -> str:
        # Rounded to what is printed, and no negative zero.
        digits = 1 + max(0, ceil(-log10(self.time_scale)))
        begin = round(self._begin(window), digits) + 0.0
        return f"{window.record.test}, {begin:.{digits}f} to {begin + window.compared:.{digits}f} s"

    def _compared(self, readings: int, highest_hz: float) -> tuple[int, NDArray[np.bool_]]:
        """From one order that is compared to the next, and which of them are, from 0 to the last."""
        last = floor(highest_hz * self.length)
        every = max(2, ceil(2 * len(self.windows) * readings * last / NUMBERS))
        return every, every * np.arange(last // every + 1) >= LOWEST_HZ / self.time_scale * self.length

    def _apart(self, window: _Window, every: int) -> int:
        """Every so many-th of the numbers of a window, ``every`` orders apart, counts.

        Amplitudes nearer to each other than two periods of what is compared share their noise.
        """
        return max(1, round(2.0 * max(each.compared for each in self.windows) / (every * window.compared)))

    def _signal(self, window: _Window, name: str, led_over: bool) -> tuple[Array, Array]:
        """A channel at the instants of a window [its unit], and the share with which each counts [1], (n,) both.

        An input is led over at the end to what it was before the beginning.
        """
        record = window.record
        count, values = round(self.length * record.rate), record.values[name]
        phase = np.asarray(2.0 * np.pi * np.arange(count) / (self.length * record.rate), np.float64)
        place = window.first + np.arange(count)
        here = values[np.minimum(place, values.size - 1)]
        begin, end = self.part(window)
        if not led_over:
            return here, compared_share(phase, begin, end)
        ahead = np.clip((phase - end) / (2.0 * np.pi - end), 0.0, 1.0)
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
