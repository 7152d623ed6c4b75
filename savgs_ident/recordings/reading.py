"""What a reader hands over before any check: the tests as they stand in the file, and what it noticed."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.channel_map import ChannelMap
from savgs_ident.recordings.recording import Recording

Progress = Callable[[float], None]
"""Told the share of the source that has been read, 0 to 1."""


@dataclass(frozen=True)
class Reading:
    """Unchecked recordings (missing samples are NaN) and the reader's own warnings."""

    recordings: tuple[Recording, ...]
    warnings: tuple[DataWarning, ...]


@dataclass(frozen=True)
class Reader:
    """One file format: its suffixes, the bytes it may begin with (none: plain text), and how it is read."""

    name: str
    suffixes: tuple[str, ...]
    magic: tuple[bytes, ...]
    plain_text: bool
    read: Callable[[Path, ChannelMap, Progress], Reading]
