"""Trials kept in a file as soon as they are there: one JSON line that says of what, then one a trial.

What a run reads is told by what is in it, not only by where it is: files are edited, and trials of two rigs are not
to be counted together.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from savgs_ident.cli.console import Progress
from savgs_ident.core.errors import InputError
from savgs_ident.core.files import write_bytes
from savgs_ident.recordings.read import campaign_files, digest_of, map_digest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Trial = TypeVar("Trial")
Made = TypeVar("Made", bound="DataclassInstance")


_STATES = {
    "rig_sha256": "state of the rig file",
    "campaign_sha256": "state of the campaign",
    "campaign_files": "names of the campaign's files",
    "channels_sha256": "state of the channel map",
}
"""Marks of what is read, in words."""


def rig_marks(content: bytes) -> dict[str, object]:
    """What marks trials made from a rig file with this content."""
    return {"rig_sha256": hashlib.sha256(content).hexdigest()}


def campaign_marks(path: Path, channels: Path | None) -> dict[str, object]:
    """What marks trials made from the campaign at ``path`` and the map of its channels, as they are now.

    Raises :class:`InputError` where they cannot be read.
    """
    try:
        files = campaign_files(path)
        return {
            "campaign_sha256": digest_of(files),
            # Tests may be named after them.
            "campaign_files": [ascii(file.name) for file in files],
            "channels_sha256": map_digest(path, channels),
        }
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror or error}",
            source=error.filename or path,
            remedy="check the path and its permissions",
        ) from error


def marks_in(kept: Path) -> dict[str, Any]:
    """What the trials of a file have in common; empty where there is no file, or not even that line is whole.

    Raises :class:`InputError` for a file that is no list of trials.
    """
    if not kept.exists():
        return {}
    try:
        first, ended, _ = kept.read_text().partition("\n")
        marks = json.loads(first) if ended else {}
    except (ValueError, RecursionError) as error:
        raise _no_list(kept) from error
    if not isinstance(marks, dict):
        raise _no_list(kept)
    return marks


def known_trials(
    kept: Path, marks: Mapping[str, object], trial: Callable[[dict[str, Any]], Trial]
) -> list[Trial]:
    """The whole trials of an earlier run; a last line that was cut off is left out and the file mended.

    ``marks`` are what trials must have in common to be counted together; ``trial`` makes one of what its line says.
    Raises :class:`InputError` for trials with other marks, and for a file that is no list of trials.
    """
    of = marks_in(kept)
    if not of:
        return []
    if of != marks:
        raise InputError(_unlike(of, marks), source=kept, remedy="name another --out DIR, or remove the file")
    lines = kept.read_text().split("\n")[1:-1]
    try:
        found = [trial(json.loads(line)) for line in lines]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise _no_list(kept) from error
    _write(kept, [json.dumps(marks), *lines])
    return found


def begin_trials(kept: Path, marks: Mapping[str, object]) -> None:
    """Begin the file anew."""
    _write(kept, [json.dumps(marks)])


def keep_trial(kept: Path, fields: Mapping[str, object]) -> None:
    """Put a trial at its end."""
    with kept.open("a") as stream:
        stream.write(json.dumps(fields) + "\n")


def completed(
    kept: Path, done: Sequence[Made], count: int, make: Callable[[int], Made], progress: Progress
) -> list[Made]:
    """``count`` trials: those ``done``, and the further ones by their numbers, each kept as soon as it is there."""
    trials = list(done)
    for number in range(len(done), count):
        progress(f"trial {number + 1} of {count}")
        trials.append(make(number))
        keep_trial(kept, asdict(trials[-1]))
    return trials[:count]


def _unlike(of: Mapping[str, object], marks: Mapping[str, object]) -> str:
    """What speaks against counting trials with the marks ``of`` together with those with ``marks``."""
    unknown = sorted(_STATES.get(name, name) for name in marks if name not in of)
    if unknown:
        return f"holds trials of an earlier version, which did not note the {', '.join(unknown)}"
    unlike = sorted(_STATES.get(name, name) for name in of if name not in marks or of[name] != marks[name])
    return f"holds trials of another {', '.join(unlike)}"


def _write(kept: Path, lines: list[str]) -> None:
    write_bytes(kept, "".join(line + "\n" for line in lines).encode())


def _no_list(kept: Path) -> InputError:
    return InputError("is no list of trials", source=kept, remedy="remove it, or name another --out DIR")
