"""A campaign of recorded tests: immutable channels in SI units, each with its own clock.

A :class:`Campaign` holds the tests of one visit to the rig: dwells, sweeps, a standstill. Every channel has its
own time stamps, because a bus samples an accelerometer and an encoder neither at the same instants nor at the
same rate. The kind of a test and its frequency are read from its name:

>>> classify_test("dwell_2.35Hz")
('dwell', 2.35)
>>> classify_test("sweep_0_3Hz_60s")
('sweep', None)

A clock that counts from 1970 gives the date of a test; a clock that starts with the recorder does not:

>>> unix_time(1_763_820_000.0), unix_time(12.5)
(1763820000.0, None)
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.layout import UNKNOWN_LAYOUT, RecordingLayout

TestKind = Literal["dwell", "sweep", "standstill", "other"]


@dataclass(frozen=True)
class RecordedChannel:
    """One measured signal: ``time`` [s] and ``values`` [``unit``], both of shape (n,), read-only."""

    name: str
    unit: str
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    source: str = ""

    def __post_init__(self) -> None:
        for field in ("time", "values"):
            array = np.asarray(getattr(self, field), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, field, array)

    @property
    def rate_hz(self) -> float:
        """Mean sampling rate [Hz]; 0 for fewer than two samples."""
        if self.time.size < 2:
            return 0.0
        return float((self.time.size - 1) / (self.time[-1] - self.time[0]))


@dataclass(frozen=True)
class Recording:
    """One test: its name, what kind it is, the frequency asked for [Hz] (None if unknown), its channels.

    ``start`` is when it began [s since 1970, UTC]; None if the clock has no date.
    """

    name: str
    kind: TestKind
    frequency_hz: float | None
    channels: Mapping[str, RecordedChannel]
    start: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample of any channel [s]."""
        filled = [channel.time for channel in self.channels.values() if channel.time.size]
        if not filled:
            return 0.0
        return float(max(time[-1] for time in filled) - min(time[0] for time in filled))


@dataclass(frozen=True)
class Campaign:
    """All tests of one source, in the order in which they were recorded.

    ``sha256`` is the digest of the bytes read, for provenance; ``warnings`` are those of the reader and the checks;
    ``layout`` says which channels there may be, and is empty where that is not known.
    """

    source: str
    recordings: tuple[Recording, ...]
    warnings: tuple[DataWarning, ...]
    sha256: str
    layout: RecordingLayout = UNKNOWN_LAYOUT

    @property
    def start(self) -> float | None:
        """When the first test began [s since 1970, UTC]; None if no clock has a date."""
        return min((each.start for each in self.recordings if each.start is not None), default=None)

    def only(self, channels: Collection[str]) -> "Campaign":
        """The same tests with no other channels than these."""
        kept = tuple(
            replace(each, channels={n: c for n, c in each.channels.items() if n in channels})
            for each in self.recordings
        )
        return replace(self, recordings=kept)

    def of_kind(self, kind: TestKind) -> tuple[Recording, ...]:
        """The tests of one kind, in recorded order."""
        return tuple(recording for recording in self.recordings if recording.kind == kind)


_FREQUENCY = re.compile(r"(?<![\d.])(\d+(?:[.,p]\d+)?)\s*_?hz", re.IGNORECASE)
_SWEEP = re.compile(r"sweep|chirp", re.IGNORECASE)
_STANDSTILL = re.compile(r"stand_?still|at_?rest|idle", re.IGNORECASE)
_DWELL = re.compile(r"dwell|harmonic|sine|sinus", re.IGNORECASE)


def classify_test(name: str) -> tuple[TestKind, float | None]:
    """Kind and frequency [Hz] (None where the name has none) of the test called ``name``."""
    if _SWEEP.search(name):
        return "sweep", None
    if _STANDSTILL.search(name):
        return "standstill", None
    found = _FREQUENCY.search(name)
    frequency = float(re.sub("[,p]", ".", found[1])) if found else None
    if frequency is not None and not (isfinite(frequency) and frequency > 0.0):
        frequency = None
    if _DWELL.search(name) or frequency is not None:
        return "dwell", frequency
    return "other", None


_YEAR_2000 = 946_684_800.0
_YEAR_2100 = 4_102_444_800.0


def unix_time(seconds: float) -> float | None:
    """``seconds`` if they are a time of this century, counted from 1970 in UTC [s]; None for any other count."""
    return seconds if _YEAR_2000 <= seconds < _YEAR_2100 else None
