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
from math import inf, isfinite, pi
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2] (ISO 80000-3)."""


@dataclass(frozen=True)
class Unit:
    """``factor`` turns a number in this unit into SI; ``dimension`` is what it measures."""

    factor: float
    dimension: str


_TABLE: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "inch": 0.0254, "ft": 0.3048},
    "acceleration": {
        "m/s^2": 1.0, "m/s2": 1.0, "m/s/s": 1.0, "ms^-2": 1.0, "ms-2": 1.0, "mm/s^2": 1e-3, "mm/s2": 1e-3,
        "g": STANDARD_GRAVITY, "g0": STANDARD_GRAVITY, "gn": STANDARD_GRAVITY,
        "mg": 1e-3 * STANDARD_GRAVITY, "gal": 1e-2,
    },
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "degree": pi / 180, "degrees": pi / 180,
              "rev": 2 * pi, "turn": 2 * pi},
    "angular velocity": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180, "degrees/s": pi / 180,
                         "rpm": pi / 30, "rev/min": pi / 30, "1/min": pi / 30, "rev/s": 2 * pi},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704,
                 "in/s": 0.0254, "ft/s": 0.3048},
    "angular acceleration": {"rad/s^2": 1.0, "rad/s2": 1.0, "deg/s^2": pi / 180, "deg/s2": pi / 180},
    "force": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "daN": 10.0, "kgf": STANDARD_GRAVITY, "lbf": 4.4482216152605},
    "torque": {"Nm": 1.0, "kNm": 1e3, "mNm": 1e-3, "Nmm": 1e-3, "Ncm": 1e-2, "lbfft": 1.3558179483314,
               "lbfin": 0.1129848290276},
    "pressure": {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "bar": 1e5, "mbar": 1e2, "psi": 6894.757293168},
    "mass": {"kg": 1.0, "gram": 1e-3, "lb": 0.45359237},
    "current": {"A": 1.0, "amp": 1.0, "ampere": 1.0, "mA": 1e-3},
    "voltage": {"V": 1.0, "mV": 1e-3, "kV": 1e3, "volt": 1.0},
    "power": {"W": 1.0, "kW": 1e3, "mW": 1e-3, "hp": 745.69987158227},
    "frequency": {"Hz": 1.0, "kHz": 1e3},
}  # fmt: skip

UNITS: Mapping[str, Unit] = MappingProxyType(
    {name: Unit(factor, dimension) for dimension, row in _TABLE.items() for name, factor in row.items()}
)
"""Every unit that is understood, by its normalised spelling."""

_SPELLINGS = (
    ("²", "^2"), ("**", "^"), ("⁻¹", "^-1"), ("⁻", "^-"), ("µ", "u"), ("μ", "u"), ("°", "deg"), ("º", "deg"),
    ("·", ""), ("*", ""), ("(", ""), (")", ""), (" ", ""),
)  # fmt: skip


def find_unit(text: str) -> Unit | None:
    """The unit written as ``text``, or None if the table does not have it.

    The spelling is tried as it stands, then in lower case (``MM``, ``Deg``, ``RPM``).
    """
    for written, plain in _SPELLINGS:
        text = text.replace(written, plain)
    return UNITS.get(text) or UNITS.get(text.lower())


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
    """

    name: str
    unit: str
    about: str
    aliases: tuple[str, ...] = ()
    largest: float = inf
    suspect: str = "another unit"
    short: str = ""


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
    """

    channels: tuple[ChannelSpec, ...] = ()
    driven: str = ""
    responses: tuple[str, ...] = ()
    still: float = inf
    joint: JointChannels | None = None
    corrections: tuple[Correction, ...] = ()
    checks: tuple[Check, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(each.name for each in self.channels)

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

        Raises :class:`InputError` for a unit that is not in the table or measures something else.
        """
        si = self.si_unit(channel)
        if text.strip() == si:
            return 1.0
        expected = find_unit(si)
        if expected is None:
            raise InputError(
                f"unit '{text}' cannot be converted to '{si}'",
                source=source,
                channel=channel,
                remedy=f"write it in '{si}', or give that unit and a scale in channels.toml",
            )
        dimension, usual = expected.dimension, ", ".join(_TABLE[expected.dimension])
        unit = find_unit(text)
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


TestKind = Literal["dwell", "sweep", "road", "standstill", "other"]


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

    @property
    def left_out(self) -> tuple[DataWarning, ...]:
        """Why tests of it were left out."""
        return tuple(each for each in self.warnings if each.code == "test_left_out")

    def of_kind(self, kind: TestKind) -> tuple[Recording, ...]:
        """The tests of one kind, in recorded order."""
        return tuple(recording for recording in self.recordings if recording.kind == kind)


_FREQUENCY = re.compile(r"(?<![\d.])(\d+(?:[.,p]\d+)?)\s*_?hz", re.IGNORECASE)
_SWEEP = re.compile(r"sweep|chirp", re.IGNORECASE)
_ROAD = re.compile(r"road|random|track|ride|drive|8608|broad_?band", re.IGNORECASE)
_STANDSTILL = re.compile(r"stand_?still|at_?rest|idle", re.IGNORECASE)
_DWELL = re.compile(r"dwell|harmonic|sine|sinus", re.IGNORECASE)


def classify_test(name: str) -> tuple[TestKind, float | None]:
    """Kind and frequency [Hz] (None where the name has none) of the test called ``name``."""
    if _SWEEP.search(name):
        return "sweep", None
    if _STANDSTILL.search(name):
        return "standstill", None
    if _ROAD.search(name) and not _DWELL.search(name):
        return "road", None
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
