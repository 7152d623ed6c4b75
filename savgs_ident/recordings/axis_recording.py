"""A recording of a servo axis under closed loop, from a MATLAB file: position, reference and the force of the drive.

The file (version 5 to 7 of MATLAB's format) has column vectors ``t`` [s], ``qm`` (measured position [m]), ``qg``
(reference [m]) and ``vir`` (controller output [V]), and the scalar ``gtau`` (force of the drive per volt [N/V]).
Pulses that were added to the controller's output are in ``vir`` already, so that nothing else is read.

The file may come from a stranger. Nothing in it is run or built: only the named arrays are read, and only if they
are real and numeric; what would unpack to more than :data:`LARGEST` bytes is refused before it does. The few parts
of such an array are read here because SciPy's reader, which knows all of the format, ends the process on some
malformed files:

    element   type, size, content; a small one has both in one word. Packed ones hold another element.
    array     flags (class, complex), shape, name, numbers: in this order, each an element of its own

Source: MathWorks, MAT-File Format, on the Level 5 format.
"""

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError

LARGEST = 2**28
"""Most bytes of a file, and of what it unpacks to."""

_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""How numbers are stored, by the type of their element."""

_CLASSES = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double", 7: "single", 8: "int8", 9: "uint8",
    10: "int16", 11: "uint16", 12: "int32", 13: "uint32", 14: "int64", 15: "uint64",
}  # fmt: skip
_FIRST_NUMERIC = 6
_COMPLEX = 0x800

_BYTES, _SHAPE, _FLAGS, _ARRAY, _PACKED = 1, 5, 6, 14, 15
_HEADER = 128
_PIECE = 2**20
_SAVE = "save it in MATLAB with save(file, '-v7')"


class _MalformedError(Exception):
    """What is there is not what the file says."""


class _Element(NamedTuple):
    """Type of an element, its content, and where the next one begins."""

    kind: int
    content: memoryview
    end: int


def read_arrays(path: Path, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """The named numeric arrays of a MATLAB file, as real double precision, of any shape and any unit.

    Raises :class:`InputError` for a file that is none, that is too large, that lacks one of them or has it twice,
    or where one is not a real numeric array.
    """
    raw, order = _content(path)
    found: dict[str, NDArray[np.float64]] = {}
    try:
        for array in _arrays(path, raw, order):
            name, parts = _header(array, order)
            if name in found:
                raise InputError("is there more than once", source=path, channel=name)
            if name in names:
                found[name] = _real(path, name, parts, order)
    except _MalformedError as error:
        raise InputError(f"its contents cannot be read ({error})", source=path, remedy=_SAVE) from error
    for name in names:
        if name not in found:
            raise InputError("is missing", source=path, channel=name)
    return found


def array_names(path: Path) -> list[str]:
    """Names of the real numeric arrays of a MATLAB file, each once; raises :class:`InputError` for no such file."""
    raw, order = _content(path)
    try:
        headers = [_header(array, order) for array in _arrays(path, raw, order)]
    except _MalformedError as error:
        raise InputError(f"its contents cannot be read ({error})", source=path, remedy=_SAVE) from error
    return list(
        dict.fromkeys(
            name
            for name, parts in headers
            if name and _FIRST_NUMERIC <= parts.flags & 0xFF <= max(_CLASSES) and not parts.flags & _COMPLEX
        )
    )


def _content(path: Path) -> tuple[bytes, str]:
    """The bytes of a file and their order."""
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
    return raw, order


def _arrays(path: Path, raw: bytes, order: str) -> Iterator[memoryview]:
    """The contents of all arrays, unpacked."""
    place, left = _HEADER, LARGEST
    while place + 8 <= len(raw):
        kind, size = struct.unpack_from(order + "II", raw, place)
        if place + 8 + size > len(raw):
            raise InputError("ends before its last array does", source=path, remedy="copy the file again")
        content = memoryview(raw)[place + 8 : place + 8 + size]
        if kind == _PACKED:
            unpacked = _unpacked(path, content, left)
            left -= len(unpacked)
            kind, content, _ = _element(memoryview(unpacked), 0, order)
        if kind == _ARRAY:
            yield content
        place += 8 + size


def _unpacked(path: Path, packed: memoryview, most: int) -> bytes:
    """What ``packed`` unpacks to, at ``most`` so many bytes."""
    unpacker, pieces, total = zlib.decompressobj(), [], 0
    rest = bytes(packed)
    try:
        while rest and not unpacker.eof:
            pieces.append(unpacker.decompress(rest, _PIECE))
            rest, total = unpacker.unconsumed_tail, total + len(pieces[-1])
            if total > most:
                raise InputError(f"unpacks to more than {LARGEST} bytes", source=path, remedy=_SAVE)
    except zlib.error as error:
        raise InputError(
            f"cannot be unpacked ({error})", source=path, remedy="copy the file again"
        ) from error
    return b"".join(pieces)


def _element(content: memoryview, place: int, order: str) -> _Element:
    """The element at a place of a content."""
    if place + 8 > len(content):
        raise _MalformedError("it ends within an array")
    kind, size = struct.unpack_from(order + "II", content, place)
    if kind >> 16:
        kind, size, begin, end = kind & 0xFFFF, kind >> 16, place + 4, place + 8
        if size > 4:
            raise _MalformedError("a small element is not small")
    else:
        begin = place + 8
        end = begin + size + -size % 8
    if begin + size > len(content):
        raise _MalformedError("it ends within an array")
    return _Element(kind, content[begin : begin + size], end)


class _Parts(NamedTuple):
    """Flags of an array, its shape, and its numbers as they are stored."""

    flags: int
    shape: tuple[int, ...]
    numbers: memoryview


def _header(array: memoryview, order: str) -> tuple[str, _Parts]:
    """Name of an array and what it consists of; what is not a numeric array has no numbers."""
    flags = _element(array, 0, order)
    if flags.kind != _FLAGS or len(flags.content) != 8:
        raise _MalformedError("an array does not say of what class it is")
    shape = _element(array, flags.end, order)
    if shape.kind != _SHAPE or len(shape.content) % 4 or len(shape.content) < 8:
        raise _MalformedError("an array has no shape")
    name = _element(array, shape.end, order)
    if name.kind != _BYTES:
        raise _MalformedError("an array has no name")
    extents = struct.unpack(f"{order}{len(shape.content) // 4}i", shape.content)
    (word,) = struct.unpack_from(order + "I", flags.content)
    return bytes(name.content).decode("latin-1"), _Parts(word, extents, array[name.end :])


def _real(path: Path, name: str, parts: _Parts, order: str) -> NDArray[np.float64]:
    """The numbers of an array, in its shape."""
    kind, remedy = _CLASSES.get(parts.flags & 0xFF, "unknown"), "save it as an array of double"
    if parts.flags & 0xFF < _FIRST_NUMERIC or kind == "unknown":
        raise InputError(f"is of class {kind}", source=path, channel=name, remedy=remedy)
    if parts.flags & _COMPLEX:
        raise InputError("is not real", source=path, channel=name, remedy=remedy)
    shape = parts.shape
    if any(extent < 0 for extent in shape) or 8 * prod(shape) > LARGEST:
        raise InputError(f"has the shape {shape}", source=path, channel=name, remedy="record a shorter test")
    stored = _element(parts.numbers, 0, order)
    if stored.kind not in _NUMBERS:
        raise _MalformedError(f"the numbers of {name} are of type {stored.kind}")
    numbers = np.dtype(order + _NUMBERS[stored.kind])
    if len(stored.content) != numbers.itemsize * prod(shape):
        raise _MalformedError(f"{name} has not as many numbers as its shape says")
    return np.frombuffer(stored.content, numbers).astype(np.float64).reshape(shape, order="F")


SIGNALS = {"t": 1e6, "qm": 1e2, "qg": 1e2, "vir": 1e4}
"""Vectors that a file must have, and sizes [s, m, m, V] beyond which they are in another unit or broken."""

GAIN = "gtau"
"""Scalar that a file must have."""

LARGEST_GAIN = 1e6
"""Largest gain that is believed [N/V]."""

JITTER = 0.01
"""Largest departure of a time from an even grid, in steps."""


@dataclass(frozen=True)
class AxisRecording:
    """One test of n evenly spaced samples.

    Attributes:
        source: file it came from.
        time: [s], (n,).
        position: of the carriage, [m], (n,).
        reference: where the carriage was to be, [m], (n,).
        force: of the drive, [N], (n,).
    """

    source: str
    time: NDArray[np.float64]
    position: NDArray[np.float64]
    reference: NDArray[np.float64]
    force: NDArray[np.float64]

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)


def is_axis(path: Path) -> bool:
    """Whether a file has all variables of such a recording; not where it cannot be read as one."""
    try:
        return {*SIGNALS, GAIN} <= {*array_names(path)}
    except InputError:
        return False


def read_axis(path: Path) -> AxisRecording:
    """A recording from a MATLAB file.

    Raises :class:`InputError` for a file that cannot be read, a signal that is missing, of another length or not
    finite, a gain that is no positive number, or times that are not even.
    """
    arrays = read_arrays(path, (*SIGNALS, GAIN))
    gain = arrays[GAIN]
    if gain.size != 1 or not 0.0 < gain.ravel()[0] < LARGEST_GAIN:
        raise InputError("must be one positive number", source=path, channel=GAIN, remedy="give it in N/V")
    signals = {name: _vector(path, name, arrays[name]) for name in SIGNALS}
    _check_times(path, signals["t"])
    for name, signal in signals.items():
        _check_signal(path, name, signal, signals["t"])
    return AxisRecording(
        str(path), signals["t"], signals["qm"], signals["qg"], float(gain.ravel()[0]) * signals["vir"]
    )


def _vector(path: Path, name: str, array: NDArray[np.float64]) -> NDArray[np.float64]:
    if array.ndim > 2 or array.size < 2 or max(array.shape) != array.size:
        raise InputError(
            f"has the shape {array.shape}", source=path, channel=name, remedy="save it as one column"
        )
    return array.ravel()


def _check_times(path: Path, time: NDArray[np.float64]) -> None:
    if not np.isfinite(time).all():
        raise InputError("has a sample that is not a number", source=path, channel="t")
    step = (time[-1] - time[0]) / (time.size - 1)
    uneven = np.abs(time - time[0] - step * np.arange(time.size)) > JITTER * abs(step)
    if step <= 0.0 or uneven.any():
        place = float(time[int(np.argmax(uneven))])
        raise InputError(
            "times are not even and rising",
            source=path,
            channel="t",
            time=place,
            remedy="resample the recording",
        )


def _check_signal(path: Path, name: str, signal: NDArray[np.float64], time: NDArray[np.float64]) -> None:
    if signal.size != time.size:
        raise InputError(f"has {signal.size} samples, but t has {time.size}", source=path, channel=name)
    lost = ~np.isfinite(signal)
    if lost.any():
        place = float(time[int(np.argmax(lost))])
        raise InputError("has a sample that is not a number", source=path, channel=name, time=place)
    if np.max(np.abs(signal)) > SIGNALS[name]:
        raise InputError(
            f"exceeds {SIGNALS[name]:g}", source=path, channel=name, remedy="give it in SI units, and in V"
        )
