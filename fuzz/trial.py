"""One input: a good file, damaged as its number says, read, and classified."""

import traceback
import warnings
import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from fuzz.limits import MEMORY, SECONDS, TooLongError, begin_peak, grown, time_limit
from fuzz.loader import Loader, Original
from fuzz.mutators.choose import damage
from fuzz.outcome import Kind, Outcome
from fuzz.sound import unsound
from savgs_ident.core.errors import InputError, one_line

LONGEST_MESSAGE = 4000
"""Characters of a refusal that somebody can still be expected to read."""


@dataclass(frozen=True)
class Damaged:
    """A file's content, and what was done to it."""

    content: bytes
    how: str


@lru_cache(maxsize=64)
def original_of(loader: Loader) -> Original:
    """The good files of a loader, made once."""
    return loader.original()


def input_of(loader: Loader, seed: int, number: int) -> Damaged:
    """The input with this number: always the same."""
    random = np.random.default_rng((seed, zlib.crc32(loader.name.encode()), number))
    contents = original_of(loader).contents
    return Damaged(*damage(contents[int(random.integers(len(contents)))], loader.form, random))


def run_trial(loader: Loader, seed: int, number: int, folder: Path, seconds: float = SECONDS) -> Outcome:
    """Make the input in an empty ``folder``, read it, classify; the file stays there."""
    damaged = input_of(loader, seed, number)
    path = place(loader, damaged.content, folder)
    kind, reason, trace = classify(loader, path, seconds)
    return Outcome(loader.name, number, kind, damaged.how, reason, trace)


def place(loader: Loader, content: bytes, folder: Path) -> Path:
    """Write a file, and what belongs beside it, into a folder; its path."""
    for name, each in {**original_of(loader).beside, loader.file: content}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(each)
    return folder / loader.file


def classify(loader: Loader, path: Path, seconds: float = SECONDS) -> tuple[Kind, str, str]:
    """Read a file within so much time of the processor: how that ended, why, and where it failed."""
    small, begin = path.stat().st_size < 100_000, begin_peak()
    try:
        with warnings.catch_warnings(record=True) as caught, time_limit(seconds):
            warnings.simplefilter("always")
            kind, reason = _read(loader, path)
    except TooLongError:
        return Kind.failed, f"takes more than {seconds:g} s", traceback.format_exc()
    except Exception as error:
        return Kind.failed, f"{type(error).__name__}: {error!s:.200}", traceback.format_exc()
    if caught:
        return (
            Kind.failed,
            f"warns: {caught[0].category.__name__}: {caught[0].message!s:.200}",
            str(caught[0]),
        )
    used = grown(begin)
    if small and used > MEMORY:
        return Kind.failed, f"takes {used >> 20} MiB of memory", ""
    return kind, reason, ""


def _read(loader: Loader, path: Path) -> tuple[Kind, str]:
    try:
        found = loader.read(path)
    except InputError as error:
        return _refusal(str(error), path)
    if found is None:
        return Kind.refused, "left alone"
    fault = unsound(found)
    return (Kind.failed, f"accepted although {fault}") if fault else (Kind.read, "")


def _refusal(message: str, path: Path) -> tuple[Kind, str]:
    """A refusal is one line that people can read and that names the file, or the folder it is in."""
    if message != one_line(message, len(message)):
        return Kind.failed, f"the refusal is not one line of plain text: {message!r:.200}"
    if len(message) > LONGEST_MESSAGE:
        return Kind.failed, f"the refusal has {len(message)} characters: {message:.100}"
    if str(path.parent) not in message:
        return Kind.failed, f"the refusal does not name the file: {message:.200}"
    return Kind.refused, message
