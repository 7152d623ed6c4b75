"""Trials of any kind: spread over processes or a cluster, kept in a file as soon as they are there, gone on with.

The file has one JSON line that says of what the trials are (their marks), then one a trial. What a run reads is
marked by its content, not only by where it is: files are edited, and trials of two rigs are not to be counted
together.
"""

import hashlib
import json
import subprocess
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from savgs_ident import __version__
from savgs_ident.core.errors import InputError
from savgs_ident.core.executor import Lost, cores, run_tasks
from savgs_ident.core.files import write_bytes
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.plants.model import Model
from savgs_ident.recordings.read import campaign_files, digest_files, map_digest
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.simulate.program_cache import make_room_for_programs, use_persistent_cache

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Trial = TypeVar("Trial")
Made = TypeVar("Made", bound="DataclassInstance")


TASKS = 6
"""Trials of a process before it makes room for a new one: compiled programs would fill the memory in time."""

_STATES = {
    "rig_sha256": "state of the rig file",
    "campaign_sha256": "state of the campaign",
    "campaign_files": "names of the campaign's files",
    "channels_sha256": "state of the channel map",
}
"""Marks of what is read, in words."""


def marks_of(
    model: Model, campaign: Campaign | DrivenMotion | str | Path, channels: str | Path | None
) -> dict[str, object]:
    """What marks trials on a model and a campaign, with the map of its channels, or on a measured motion.

    Raises :class:`InputError` where they cannot be read.
    """
    marks: dict[str, object] = {
        "rig": model.source,
        "rig_sha256": model.sha256,
        "effects": list(model.effects),
        "channels": str(channels),
    }
    if isinstance(campaign, DrivenMotion):
        measured = np.concatenate([campaign.position, campaign.drive]).tobytes()
        return marks | {"campaign": campaign.source, "campaign_sha256": hashlib.sha256(measured).hexdigest()}
    path = campaign.source if isinstance(campaign, Campaign) else campaign
    read = campaign_marks(Path(path), None if channels is None else Path(channels))
    return marks | {"campaign": str(path), **read}


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
            "campaign_sha256": digest_files(files),
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


@cache
def code_version() -> str:
    """The commit of the checkout that this package is in, as git describes it; else the version of the package."""
    package = Path(__file__).resolve().parents[1]
    try:
        top = _git(package, "rev-parse", "--show-toplevel")
        if Path(top).resolve() == package.parent:
            return _git(package, "describe", "--always", "--dirty")
    except (OSError, subprocess.SubprocessError):
        pass
    return __version__


def _git(folder: Path, *words: str) -> str:
    """What git says of a folder, in a line; raises where it says nothing."""
    command = ["git", "-C", str(folder), *words]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10.0).stdout.strip()


def marks_in(file: Path) -> dict[str, Any]:
    """What the trials of a file have in common; empty where there is no file, or not even that line is whole.

    Raises :class:`InputError` for a file that is no list of trials.
    """
    if not file.exists():
        return {}
    try:
        first, ended, _ = file.read_text().partition("\n")
        marks = json.loads(first) if ended else {}
    except (ValueError, RecursionError) as error:
        raise _no_list(file) from error
    if not isinstance(marks, dict):
        raise _no_list(file)
    return marks


def known_trials(
    file: Path, marks: Mapping[str, object], trial: Callable[[dict[str, Any]], Trial]
) -> list[Trial]:
    """The whole trials of an earlier run; a last line that was cut off is left out and the file mended.

    ``marks`` are what trials must have in common to be counted together; ``trial`` makes one of what its line says.
    Raises :class:`InputError` for trials with other marks, and for a file that is no list of trials.
    """
    of = marks_in(file)
    if not of:
        return []
    if of != marks:
        raise InputError(_unlike(of, marks), source=file, remedy="name another --out DIR, or remove the file")
    lines = file.read_text().split("\n")[1:-1]
    try:
        found = [trial(json.loads(line)) for line in lines]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise _no_list(file) from error
    _write(file, [json.dumps(marks), *lines])
    return found


def begin_trials(file: Path, marks: Mapping[str, object]) -> None:
    """Begin the file anew."""
    _write(file, [json.dumps(marks)])


def append_trial(file: Path, fields: Mapping[str, object]) -> None:
    """Put a trial at its end."""
    with file.open("a") as stream:
        stream.write(json.dumps(fields) + "\n")


@dataclass(frozen=True)
class TrialFile:
    """A file of trials, and what they have in common.

    Attributes:
        path: of the file.
        marks: what trials must have in common to be counted together.
        resume: whether trials that are there already count; they are removed otherwise.
    """

    path: Path
    marks: Mapping[str, object]
    resume: bool

    def earlier(self, trial: Callable[[dict[str, Any]], Trial]) -> list[Trial]:
        """The trials that count already; raises as :func:`known_trials` does."""
        return known_trials(self.path, self.marks, trial) if self.resume else []


def run_trials(
    work: Callable[[int], Made],
    count: int,
    file: TrialFile | None,
    done: Sequence[Made] = (),
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Progress = no_progress,
) -> list[Made]:
    """The trials 0 to ``count`` - 1, in order: those ``done``, and the others as ``work`` makes them.

    Each is written to ``file`` as soon as it is there. The work is spread, and what goes wrong with it is raised, as
    :func:`side_by_side` says; one at a time is done in this process, which has prepared it.
    """
    if file is not None and not done:
        begin_trials(file.path, file.marks)
    found = {_number(each): each for each in done}
    missing = [number for number in range(count) if number not in found]
    workers = cores() if jobs is None else jobs
    alone = workers == 1 or len(missing) < 2
    with closing(side_by_side(work, missing, 0 if alone else workers, scheduler)) as results:
        for made in results:
            found[_number(made)] = made
            if file is not None:
                append_trial(file.path, asdict(made))
            progress(f"{sum(number < count for number in found)} of {count} trials done")
    return [found[number] for number in range(count)]


def side_by_side(
    work: Callable[[int], Made], numbers: Sequence[int], jobs: int | None = None, scheduler: str | None = None
) -> Generator[Made]:
    """The results of ``work``, defined at the top of a module, as they come.

    ``jobs`` at a time in processes of this machine, one for each core if None, in this process if 0, or on the Dask
    cluster of a ``scheduler``. An error of the work is raised here and ends the others. Raises :class:`InputError`
    in the end, when the others are done, for what was given up because its process was killed.
    """
    workers = cores() if jobs is None else jobs
    lost: list[tuple[int, Lost]] = []
    prepared = partial(_prepared, work)
    for place, result in run_tasks(prepared, numbers, workers, scheduler, TASKS):
        if isinstance(result, Lost):
            lost.append((numbers[place], result))
        else:
            yield result
    for number, result in lost:
        raise InputError(
            result.reason,
            source=f"trial {number}",
            remedy="run again with fewer --jobs, which take less memory: it goes on where it was",
        )


_MADE: dict[str, Any] = {}


def once_a_process(key: str, make: Callable[[], Trial]) -> Trial:
    """What ``make`` makes, once in each process that is asked for the same ``key`` again and again."""
    if key not in _MADE:
        _MADE.clear()
        _MADE[key] = make()
    made: Trial = _MADE[key]
    return made


def _prepared(work: Callable[[int], Made], number: int) -> Made:
    use_persistent_cache()
    make_room_for_programs()
    return work(number)


def _number(made: Any) -> int:
    number: int = made.number
    return number


def _unlike(of: Mapping[str, object], marks: Mapping[str, object]) -> str:
    """What speaks against counting trials with the marks ``of`` together with those with ``marks``."""
    unknown = sorted(_STATES.get(name, name) for name in marks if name not in of)
    if unknown:
        return f"holds trials of an earlier version, which did not note the {', '.join(unknown)}"
    unlike = sorted(_STATES.get(name, name) for name in of if name not in marks or of[name] != marks[name])
    return f"holds trials of another {', '.join(unlike)}"


def _write(file: Path, lines: list[str]) -> None:
    write_bytes(file, "".join(line + "\n" for line in lines).encode())


def _no_list(file: Path) -> InputError:
    return InputError("is no list of trials", source=file, remedy="remove it, or name another --out DIR")
