"""Trials kept in a file as soon as they are there: one JSON line that says of what, then one a trial."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from savgs_ident.core.errors import InputError

Trial = TypeVar("Trial")


def known_trials(kept: Path, marks: Mapping[str, object], trial: Callable[..., Trial]) -> list[Trial]:
    """The whole trials of an earlier run; a last line that was cut off is left out and the file mended.

    ``marks`` are what trials must have in common to be counted together, ``trial`` makes one of its fields. Raises
    :class:`InputError` for trials with other marks, and for a file that is no list of trials.
    """
    if not kept.exists():
        return []
    try:
        lines = kept.read_text().split("\n")[:-1]
        of, *trials = (json.loads(line) for line in lines)
        found = [trial(**each) for each in trials]
    except (ValueError, TypeError) as error:
        raise InputError("is no list of trials", source=kept, remedy="leave out --resume") from error
    if of != marks:
        raise InputError(
            "holds trials of something else (" + ", ".join(_differing(of, marks)) + ")",
            source=kept,
            remedy="leave out --resume, or name another --out DIR",
        )
    kept.write_text("\n".join(lines) + "\n")
    return found


def begin_trials(kept: Path, marks: Mapping[str, object]) -> None:
    """Begin the file anew."""
    kept.write_text(json.dumps(marks) + "\n")


def keep_trial(kept: Path, fields: Mapping[str, object]) -> None:
    """Put a trial at its end."""
    with kept.open("a") as stream:
        stream.write(json.dumps(fields) + "\n")


def _differing(of: object, marks: Mapping[str, object]) -> list[str]:
    known = of if isinstance(of, dict) else {}
    return sorted(str(name) for name in {*known, *marks} if known.get(name) != marks.get(name))
