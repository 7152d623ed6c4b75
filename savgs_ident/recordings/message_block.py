"""Many messages of one topic inside one buffer, and reading the same field of all of them at once."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import SavgsIdentError

_HEAD = 31
"""Bytes before the payload of an MCAP message record: opcode, length, channel, sequence, two times."""
_LENGTH_AT, _LOG_AT, _PUBLISH_AT = 1, 15, 23
_BEFORE_PAYLOAD = 22


class DecodeError(SavgsIdentError):
    """A message that cannot be decoded: why, and which of the block; the reader adds topic and time."""

    def __init__(self, why: str, index: int = 0) -> None:
        super().__init__(why)
        self.index = index


@dataclass(frozen=True)
class MessageBlock:
    """``data`` holds the message records; payload i is ``data[starts[i]:stops[i]]``; times [ns], (n,)."""

    data: bytes
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]
    log: NDArray[np.int64]
    publish: NDArray[np.int64]

    def payload(self, index: int) -> bytes:
        """The bytes of one message."""
        return self.data[self.starts[index] : self.stops[index]]


def gather(data: bytes, positions: NDArray[np.int64], code: str) -> NDArray[Any]:
    """The numbers of type ``code`` that begin at ``positions``, aligned or not, shape (n,)."""
    kind = np.dtype(code)
    raw = np.frombuffer(data, dtype=np.uint8)
    picked: NDArray[Any] = raw[positions[:, None] + np.arange(kind.itemsize)]
    return picked.view(kind).ravel()


def message_block(data: bytes, records: NDArray[np.int64]) -> MessageBlock:
    """The messages whose records begin at ``records`` (n,) in ``data``."""
    length = gather(data, records + _LENGTH_AT, "<u8").astype(np.int64)
    log = gather(data, records + _LOG_AT, "<i8").astype(np.int64)
    publish = gather(data, records + _PUBLISH_AT, "<i8").astype(np.int64)
    starts = records + _HEAD
    return MessageBlock(data, starts, starts + length - _BEFORE_PAYLOAD, log, publish)
