"""Numeric arrays out of a MATLAB file (version 5 to 7), from a stranger.

Nothing in the file is run or built: only named numeric arrays are read, after the file's own list of contents has
said that they are numeric and how large they are, and after everything that is packed in it has been weighed. What
would unpack to more than :data:`LARGEST` bytes is refused before it does.
"""

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatReadError

from savgs_ident.core.errors import InputError

LARGEST = 2**28
"""Most bytes of a file, and of what it unpacks to."""

NUMERIC = frozenset(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)) | {
    "double",
    "single",
}
"""Classes of arrays that are read."""

_HEADER = 128
_PACKED = 15
_PIECE = 2**20
_SAVE = "save it in MATLAB with save(file, '-v7')"

_MALFORMED = (
    MatReadError, NotImplementedError, ValueError, TypeError, KeyError, IndexError, OverflowError, MemoryError,
    EOFError, OSError, zlib.error, struct.error,
)  # fmt: skip
"""What SciPy's reader raises for contents that are not what they say."""


def read_arrays(path: Path, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """The named numeric arrays of a MATLAB file, as real double precision.

    Raises :class:`InputError` for a file that is none, that is too large, that lacks one of them or has it twice,
    or where one is not a real numeric array.
    """
    _weigh(path)
    try:
        listed = whosmat(path)
    except _MALFORMED as error:
        raise InputError(
            f"its list of contents cannot be read ({error})", source=path, remedy=_SAVE
        ) from error
    for name in names:
        _check_listed(path, name, [each for each in listed if each[0] == name])
    try:
        contents = loadmat(path, variable_names=list(names))
        found = {name: np.asarray(contents[name]) for name in names}
    except _MALFORMED as error:
        raise InputError(f"its contents cannot be read ({error})", source=path, remedy=_SAVE) from error
    return {name: _real(path, name, array) for name, array in found.items()}


def _weigh(path: Path) -> None:
    """Walks through the elements of the file and unpacks them piecewise, to nothing."""
    if not path.is_file():
        raise InputError("is no file", source=path)
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"larger than {LARGEST} bytes", source=path, remedy="record a shorter test")
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be opened ({error.strerror})", source=path) from error
    order = {b"IM": "<", b"MI": ">"}.get(raw[126:128])
    if order is None or len(raw) <= _HEADER or raw[:4].count(0):
        raise InputError("not a MATLAB file of version 5 to 7", source=path, remedy=_SAVE)
    place, total = _HEADER, 0
    while place + 8 <= len(raw):
        kind, size = struct.unpack_from(order + "II", raw, place)
        if place + 8 + size > len(raw):
            raise InputError("ends before its last array does", source=path, remedy="copy the file again")
        total += (
            _unpacked(path, raw[place + 8 : place + 8 + size], LARGEST - total) if kind == _PACKED else size
        )
        place += 8 + size


def _unpacked(path: Path, packed: bytes, most: int) -> int:
    """How many bytes ``packed`` unpacks to."""
    unpacker, total = zlib.decompressobj(), 0
    try:
        while packed and not unpacker.eof:
            total += len(unpacker.decompress(packed, _PIECE))
            packed = unpacker.unconsumed_tail
            if total > most:
                raise InputError(f"unpacks to more than {LARGEST} bytes", source=path, remedy=_SAVE)
    except zlib.error as error:
        raise InputError(
            f"cannot be unpacked ({error})", source=path, remedy="copy the file again"
        ) from error
    return total


def _check_listed(path: Path, name: str, found: Sequence[tuple[str, tuple[int, ...], str]]) -> None:
    if not found:
        raise InputError("is missing", source=path, channel=name)
    if len(found) > 1:
        raise InputError("is there more than once", source=path, channel=name)
    _, shape, kind = found[0]
    if kind not in NUMERIC:
        raise InputError(
            f"is of class {kind}", source=path, channel=name, remedy="save it as an array of double"
        )
    size = 8
    for extent in shape:
        size *= extent
    if not 0 <= size <= LARGEST or any(extent < 0 for extent in shape):
        raise InputError(f"has the shape {shape}", source=path, channel=name, remedy="record a shorter test")


def _real(path: Path, name: str, array: NDArray[np.generic]) -> NDArray[np.float64]:
    if array.dtype.kind not in "fiu":
        raise InputError("is not real", source=path, channel=name, remedy="save it as an array of double")
    return array.astype(np.float64)
