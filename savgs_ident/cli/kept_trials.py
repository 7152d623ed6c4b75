"""Trials kept in a file as soon as they are there: one JSON line that says of what, then one a trial."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from savgs_ident.cli.console import Progress
from savgs_ident.core.errors import InputError
from savgs_ident.core.files import write_bytes

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Trial = TypeVar("Trial")
Made = TypeVar("Made", bound="DataclassInstance")


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
        unlike = sorted(name for name in {*of, *marks} if of.get(name) != marks.get(name))
        raise InputError(
            f"holds trials of another {', '.join(unlike)}",
            source=kept,
            remedy="name another --out DIR, or remove the file",
        )
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


def _write(kept: Path, lines: list[str]) -> None:
    write_bytes(kept, "".join(line + "\n" for line in lines).encode())


def _no_list(kept: Path) -> InputError:
    return InputError("is no list of trials", source=kept, remedy="remove it, or name another --out DIR")
