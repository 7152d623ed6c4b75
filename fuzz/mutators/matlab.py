"""MATLAB files whose arrays are not what they were, or unpack to more than a file of measurements would."""

import struct
import zlib
from collections.abc import Callable, Mapping
from functools import lru_cache
from io import BytesIO
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.io import loadmat, savemat

_HEAD = 116
"""Bytes of text at the head of a file."""


def damage_matlab(content: bytes, random: Generator) -> bytes:
    """A file written anew with a damaged array, or with a packed one that is damaged within."""
    match int(random.integers(10)):
        case 0:
            packed = _packed_zeros()
            return content + struct.pack("<II", 15, len(packed)) + packed
        case 1:
            return content[:128] + b"".join(_within(content, random))
    arrays = {name: each for name, each in loadmat(BytesIO(content)).items() if not name.startswith("__")}
    for _ in range(int(random.choice([1, 1, 2]))):
        names = list(arrays)
        name = names[int(random.integers(len(names)))]
        arrays[name] = _CHANGES[int(random.integers(len(_CHANGES)))](arrays[name], random)
        if arrays[name] is None:
            del arrays[name]
    return written(arrays, random.random() < 0.5)


def written(arrays: Mapping[str, Any], packed: bool) -> bytes:
    """A MATLAB file of arrays, the same whenever it is written: its head says no time."""
    stream = BytesIO()
    savemat(stream, dict(arrays), do_compression=packed)
    content = stream.getvalue()
    return b"MATLAB 5.0 MAT-file".ljust(_HEAD) + content[_HEAD:]


def _within(content: bytes, random: Generator) -> list[bytes]:
    """The arrays, unpacked, a few bytes changed, packed again."""
    found, at = [], 128
    while at + 8 <= len(content):
        kind, size = struct.unpack_from("<II", content, at)
        body = content[at + 8 : at + 8 + size]
        if kind == 15:
            inner = bytearray(zlib.decompress(body))
            inner[int(random.integers(min(len(inner), 80)))] = int(random.choice([0, 1, 127, 255]))
            body = zlib.compress(bytes(inner))
        found.append(struct.pack("<II", kind, len(body)) + body)
        at += 8 + size
    return found


@lru_cache(maxsize=1)
def _packed_zeros() -> bytes:
    packer = zlib.compressobj(9)
    piece = bytes(1 << 20)
    return b"".join(packer.compress(piece) for _ in range(300)) + packer.flush()


def _is_numeric(array: Any) -> bool:
    return isinstance(array, np.ndarray) and array.dtype.kind == "f" and array.size > 0


def _spoilt(array: Any, random: Generator) -> Any:
    """A number in it that cannot be."""
    if not _is_numeric(array):
        return array
    changed = np.array(array)
    changed.flat[int(random.integers(array.size))] = random.choice([np.nan, np.inf, 1e300, -1e300, 0.0])
    return changed


def _of_numbers(change: Callable[[Any], Any]) -> Callable[[Any, Generator], Any]:
    return lambda array, random: change(array) if _is_numeric(array) else array


_CHANGES: tuple[Callable[[Any, Generator], Any], ...] = (
    _spoilt,
    _spoilt,
    lambda array, random: None,
    _of_numbers(lambda array: array[: len(array) // 2]),
    _of_numbers(lambda array: array[:-1]),
    _of_numbers(lambda array: array.T),
    _of_numbers(lambda array: array[::-1]),
    _of_numbers(lambda array: np.tile(array, (1, 2))),
    _of_numbers(lambda array: array.astype(complex)),
    _of_numbers(lambda array: np.full_like(array, 5e-324)),
    _of_numbers(lambda array: array.astype(np.int8)),
    lambda array, random: np.zeros((0, 0)),
    lambda array, random: "a text",
    lambda array, random: {"field": 1.0},
    lambda array, random: np.zeros((2, 2, 2, 2)),
    lambda array, random: np.array([["a", 1.0]], dtype=object),
)
