"""What the recordings of a plant hold: channels with their units and usual names, and what must hold of them.

A plant brings one :class:`RecordingLayout`; readers and checks know no channel but those in it. Usual names are
recognised, with the unit in the header or without it. A unit has a dimension: a deflection in seconds is an error.

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
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, pi
from types import MappingProxyType
from typing import TYPE_CHECKING

from savgs_ident.core.errors import DataWarning, InputError

if TYPE_CHECKING:
    from savgs_ident.recordings.recording import Recording

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
    "current": {"A": 1.0, "amp": 1.0, "ampere": 1.0, "mA": 1e-3},
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
        dimension = UNITS[self.si_unit(channel)].dimension
        usual = ", ".join(_TABLE[dimension])
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
