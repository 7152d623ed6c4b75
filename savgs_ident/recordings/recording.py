"""What recordings of a plant hold, and a campaign of them: immutable channels in SI units, each with its clock.

A plant brings one :class:`RecordingLayout`: channels with their units and usual names, and what must hold of them.
Readers and checks know no channel but those in it. Usual names are recognised, with the unit in the header or without
it. A unit has a dimension: a deflection in seconds is an error.

>>> pot = ChannelSpec("susp_deflection", "m", "suspension deflection", ("suspension_deflection", "deflection"))
>>> layout = RecordingLayout((pot,))
>>> layout.unit_factor("mm", "susp_deflection")
0.001
>>> layout.split_header("time (ms)")
Header(label='time', unit='ms')
>>> layout.split_header("deflection_mm")
Header(label='deflection', unit='mm')
>>> layout.canonical_name("Suspension Deflection")
'susp_deflection'

A :class:`Campaign` holds the tests of one visit to the rig: dwells, sweeps, a standstill. Every channel has its
own time stamps, because a bus samples an accelerometer and an encoder neither at the same instants nor at the
same rate. The kind of a test and its frequency are read from its name:

>>> classify_test("dwell_2.35Hz")
('dwell', 2.35)
>>> classify_test("sweep_0_3Hz_60s")
('sweep', None)
>>> classify_test("road_class_c")
('road', None)

A clock that counts from 1970 gives the date of a test; a clock that starts with the recorder does not:

>>> unix_time(1_763_820_000.0), unix_time(12.5)
(1763820000.0, None)
"""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isfinite
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.units import factor_between, find_unit, usual_units


def _with_article(dimension: str) -> str:
    return f"{'an' if dimension[0] in 'a' else 'a'} {dimension}"


_TIME = ("time", "t", "timestamp", "time_stamp", "elapsed", "elapsed_time")
_BRACKETED = re.compile(r"^(?P<label>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")


@dataclass(frozen=True)
class Header:
    """A column header or field name: its label, and its unit where one is written."""

    label: str
    unit: str | None


def normalise(label: str) -> str:
    """Lower case, words joined by underscores, camelCase split."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", label.strip())
    return re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")


@dataclass(frozen=True)
class ChannelSpec:
    """One channel that a test may have recorded.

    Attributes:
        name: by which it is known, in ``channels.toml`` and everywhere after.
        unit: SI.
        about: what it is, in a few words.
        aliases: usual names besides, normalised (:func:`normalise`), for a signal of the same sign.
        largest: magnitude [``unit``] beyond which a value is in another unit.
        suspect: what such a value is likely to be in.
        short: heading of a narrow column.
        free: whether it is none of the plant's, but was recorded beside, as a temperature of the oil.
    """

    name: str
    unit: str
    about: str
    aliases: tuple[str, ...] = ()
    largest: float = inf
    suspect: str = "another unit"
    short: str = ""
    free: bool = False


@dataclass(frozen=True)
class JointChannels:
    """The channels that the position and the velocity of a joint in ``sensor_msgs/JointState`` are.

    ``word`` is in the name of the joint that is meant where a message has several.
    """

    word: str
    position: str
    velocity: str


Correction = Callable[[Sequence["Recording"], str], tuple[tuple["Recording", ...], tuple[DataWarning, ...]]]
"""From the tests and the name of their source to corrected tests, with a warning for what was changed."""
Check = Callable[[Sequence["Recording"], str], tuple[DataWarning, ...]]
"""From the tests and the name of their source to warnings."""


SLOWEST_HZ = 2.0
"""Samples a second [Hz] that a logger takes at least, of a plant as fast as a quarter car."""


@dataclass(frozen=True)
class RecordingLayout:
    """The channels of a plant's recordings, and what is known about them.

    Attributes:
        channels: in the order in which they are listed.
        driven: the channel that a dwell or a sweep moves; empty where none is known.
        responses: channels of which a dwell or a sweep needs one at least.
        still: largest peak-to-peak of the driven channel in a standstill [its unit].
        joint: channels that a joint's state gives, if any.
        corrections: applied to all tests together once each is clean.
        checks: what must hold of the plant whatever its parameters.
        slowest_hz: samples a second [Hz] below which the time is taken to be in another unit.
    """

    channels: tuple[ChannelSpec, ...] = ()
    driven: str = ""
    responses: tuple[str, ...] = ()
    still: float = inf
    joint: JointChannels | None = None
    corrections: tuple[Correction, ...] = ()
    checks: tuple[Check, ...] = ()
    slowest_hz: float = SLOWEST_HZ

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(each.name for each in self.channels)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of those that are none of the plant's."""
        return tuple(each.name for each in self.channels if each.free)

    @cached_property
    def specs(self) -> Mapping[str, ChannelSpec]:
        """The channels by name."""
        return {each.name: each for each in self.channels}

    @cached_property
    def _by_alias(self) -> Mapping[str, str]:
        aliases = {alias: each.name for each in self.channels for alias in (each.name, *each.aliases)}
        return aliases | dict.fromkeys(_TIME, "time")

    def si_unit(self, channel: str) -> str:
        """The SI unit of a channel, or of ``time``."""
        return "s" if channel == "time" else self.specs[channel].unit

    def canonical_name(self, label: str) -> str | None:
        """The channel (or ``time``) that ``label`` usually stands for, or None."""
        return self._by_alias.get(normalise(label))

    def is_exact(self, label: str) -> bool:
        """Whether ``label`` is the name of a channel itself, not one of its usual variants."""
        return normalise(label) in self.specs

    def split_header(self, text: str) -> Header:
        """Label and unit of ``name [unit]``, ``name (unit)`` or ``name_unit``."""
        text = text.strip()
        match = _BRACKETED.match(text)
        if match and match["label"]:
            return Header(match["label"].strip(), match["unit"].strip())
        label, _, tail = text.rpartition("_")
        if label and self.canonical_name(text) is None and self.canonical_name(label) and find_unit(tail):
            return Header(label, tail)
        return Header(text, None)

    def unit_factor(self, text: str, channel: str, *, source: object = "") -> float:
        """The factor from the unit ``text`` to the SI unit of ``channel`` (or ``time``).

        Raises :class:`InputError` for a unit that nobody knows or that measures something else.
        """
        si = self.si_unit(channel)
        if text.strip() == si:
            return 1.0
        expected, unit = find_unit(si), find_unit(text)
        if expected is None or unit is None:
            factor = factor_between(text, si)
            if factor is not None:
                return factor
        if expected is None:
            raise InputError(
                f"unit '{text}' cannot be converted to '{si}'",
                source=source,
                channel=channel,
                remedy=f"write it in '{si}', or give that unit, a scale and an offset in channels.toml",
            )
        dimension, usual = expected.dimension, ", ".join(usual_units(expected.dimension))
        if unit is None:
            raise InputError(
                f"unknown unit '{text}'",
                source=source,
                channel=channel,
                remedy=f"write one of {usual}, or give unit and scale in channels.toml",
            )
        if unit.dimension != dimension:
            raise InputError(
                f"unit '{text}' is {_with_article(unit.dimension)}, the channel is {_with_article(dimension)}",
                source=source,
                channel=channel,
                remedy=f"write one of {usual}, or map the right signal in channels.toml",
            )
        return unit.factor


UNKNOWN_LAYOUT = RecordingLayout()
"""Of recordings about which nothing is known."""


TestKind = Literal["dwell", "sweep", "road", "step", "decay", "standstill", "other"]


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

    def when(self, test: str, seconds: float = 0.0) -> float:
        """When so many ``seconds`` of a test had gone by [s since 1970, UTC], where all tests are dated.

        Otherwise in tests: its place among them, and the share of it that had gone by [1]. Standstills do not count.
        """
        moving = [each for each in self.recordings if each.kind != "standstill"]
        place, mine = next((n, each) for n, each in enumerate(moving) if each.name == test)
        if mine.start is not None and all(each.start is not None for each in moving):
            return mine.start + seconds
        return place + seconds / (mine.duration_s or 1.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all channels that were recorded."""
        return tuple(dict.fromkeys(name for each in self.recordings for name in each.channels))

    def only(self, channels: Collection[str]) -> "Campaign":
        """The same tests with no other channels than these."""
        kept = tuple(
            replace(each, channels={n: c for n, c in each.channels.items() if n in channels})
            for each in self.recordings
        )
        return replace(self, recordings=kept)

    @property
    def left_out(self) -> tuple[DataWarning, ...]:
        """Why tests of it were left out."""
        return tuple(each for each in self.warnings if each.code == "test_left_out")

    def of_kind(self, kind: TestKind) -> tuple[Recording, ...]:
        """The tests of one kind, in recorded order."""
        return tuple(recording for recording in self.recordings if recording.kind == kind)


_FREQUENCY = re.compile(r"(?<![\d.])(\d+(?:[.,p]\d+)?)\s*_?hz", re.IGNORECASE)
_SWEEP = re.compile(r"sweep|chirp", re.IGNORECASE)
_ROAD = re.compile(r"road|random|track|ride|drive|8608|broad_?band|multi[ _-]?sin", re.IGNORECASE)
_STANDSTILL = re.compile(r"stand_?still|at_?rest|idle", re.IGNORECASE)
_PULSE = re.compile(r"square|pulse|bump", re.IGNORECASE)
_STEP = re.compile(r"step", re.IGNORECASE)
_DECAY = re.compile(r"decay|ring[ _-]?down|pluck|release|free[ _-]?vib", re.IGNORECASE)
_DWELL = re.compile(r"dwell|harmonic|(?<!multi)(?<!multi[ _-])(sine|sinus)", re.IGNORECASE)


def classify_test(name: str) -> tuple[TestKind, float | None]:
    """Kind and frequency [Hz] (None where the name has none) of the test called ``name``."""
    if _SWEEP.search(name):
        return "sweep", None
    if _STANDSTILL.search(name):
        return "standstill", None
    if _ROAD.search(name) and not _DWELL.search(name):
        return "road", None
    if _DECAY.search(name) and not _DWELL.search(name):
        return "decay", None
    if _PULSE.search(name) and not _DWELL.search(name):
        return "step", None
    found = _FREQUENCY.search(name)
    frequency = float(re.sub("[,p]", ".", found[1])) if found else None
    if frequency is not None and not (isfinite(frequency) and frequency > 0.0):
        frequency = None
    if _DWELL.search(name) or frequency is not None:
        return "dwell", frequency
    # A step with a frequency is one of a programme of dwells.
    return "step" if _STEP.search(name) else "other", None


_YEAR_2000 = 946_684_800.0
_YEAR_2100 = 4_102_444_800.0


def unix_time(seconds: float) -> float | None:
    """``seconds`` if they are a time of this century, counted from 1970 in UTC [s]; None for any other count."""
    return seconds if _YEAR_2000 <= seconds < _YEAR_2100 else None
