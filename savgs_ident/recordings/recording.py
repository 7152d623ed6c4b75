"""A recorded test as immutable channels in SI, each with its own clock.

A :class:`Campaign` is what one afternoon at the rig gives: dwells, sweeps, a standstill. Channels carry
their own time stamps, because a bus samples an accelerometer and an encoder neither at the same instants
nor at the same rate.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning

CANONICAL_UNITS: Mapping[str, str] = MappingProxyType(
    {
        "road_height": "m",
        "sprung_accel": "m/s^2",
        "susp_deflection": "m",
        "link_angle": "rad",
        "link_velocity": "rad/s",
        "motor_current": "A",
    }
)
"""The canonical channels and the SI unit of each."""

TestKind = Literal["dwell", "sweep", "standstill", "other"]


@dataclass(frozen=True)
class Channel:
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
    """One test: its name, what kind it is, the frequency asked for [Hz] (None if not told), its channels.

    ``start`` is when it began [s since 1970, UTC]; None if the clock does not tell the date.
    """

    name: str
    kind: TestKind
    frequency_hz: float | None
    channels: Mapping[str, Channel]
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

    ``sha256`` is the digest of the bytes read, for provenance; ``warnings`` is what the checks found.
    """

    source: str
    recordings: tuple[Recording, ...]
    warnings: tuple[DataWarning, ...]
    sha256: str

    @property
    def start(self) -> float | None:
        """When the first test began [s since 1970, UTC]; None if no clock tells the date."""
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
