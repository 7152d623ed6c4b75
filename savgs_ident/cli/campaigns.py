"""Many campaigns: found, those without a result identified side by side, each kept at once, and all put together."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from savgs_ident import __version__
from savgs_ident.cli.campaign_files import FILE_NAMES, write_study
from savgs_ident.cli.campaign_search import Found, check_apart, find_campaigns, in_natural_order
from savgs_ident.cli.campaign_store import (
    Kept,
    MadeFrom,
    forget_parts,
    has_result,
    keep_result,
    kept_result,
    made_from,
)
from savgs_ident.cli.campaign_work import Failure, Outcome, Task, one_line
from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.dask_cluster import on_cluster
from savgs_ident.cli.guard import BAD_INPUT, NOT_TRUSTED, OK
from savgs_ident.cli.identify import Job
from savgs_ident.cli.models import effects_of, free_parameters, rig_before
from savgs_ident.cli.supervised import Lost, supervised
from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import parse_rig, rig_content
from savgs_ident.effects.registry import model_parameters
from savgs_ident.recordings.channel_map import read_channel_map
from savgs_ident.report.campaigns_study import CampaignRow, RowStatus, row_of, study_campaigns
from savgs_ident.report.campaigns_text import campaigns_text
from savgs_ident.report.campaigns_words import alarm, row_words
from savgs_ident.report.files import prepare_folder
from savgs_ident.report.terminal import plain

Work = Callable[[Task], Outcome]
Spread = Callable[[Work, Sequence[Task]], Iterator[tuple[int, Outcome | Lost]]]
"""Does the work on all tasks; gives their numbers and results as they come."""


@dataclass(frozen=True)
class ManyJob:
    """What to identify: ``one`` says how each, its campaign left open; ``arguments`` where they are."""

    arguments: tuple[Path, ...]
    one: Job
    scheduler: str | None
    workers: int


@dataclass(frozen=True)
class _Pending:
    """A campaign without a result, and what its result will be made from."""

    found: Found
    origin: MadeFrom


@dataclass(frozen=True)
class _Ended:
    """What became of a campaign; ``unreadable`` if it could not even be read."""

    row: CampaignRow
    unreadable: bool = False


def spread_of(job: ManyJob) -> Spread:
    """Processes of this machine, or a cluster if the job names one."""
    if job.scheduler is not None:
        return partial(on_cluster, job.scheduler)
    return lambda work, tasks: supervised(work, tasks, min(job.workers, len(tasks)))


def run_campaigns(job: ManyJob, work: Work, spread: Spread, voice: Voice, out: Path) -> int:
    """Identify what has no result yet, write and tell what all say; the exit code.

    ``work`` makes the result of a task and ``spread`` does it on all, see :func:`spread_of`. Raises
    :class:`InputError` for what concerns all campaigns: an argument, the rig, the settings, the folder, the cluster.
    """
    # As it is now: a change during the run concerns no campaign.
    rig = rig_content(job.one.rig)
    settings = _settings(job.one, rig)
    found = find_campaigns(job.arguments, FILE_NAMES)
    check_apart(out, job.arguments, found, FILE_NAMES)
    prepare_folder(out)
    forget_parts(out, FILE_NAMES)
    with voice.working() as progress:
        ended, pending = _what_is_there(job.one.channels, found, rig, settings, out, progress)
        if pending:
            progress(f"identifying {_campaigns(len(pending))}")
            tasks = [_task(job, each, rig) for each in pending]
            for number, outcome in spread(work, tasks):
                ended.append(_conclude(pending[number], outcome, out))
                progress(f"{len(ended)} of {len(found)} done; {row_words(ended[-1].row)}")
        study = study_campaigns([each.row for each in ended], in_natural_order)
        record, files = write_study(study, settings, job.one.command, out, progress)
    voice.show(campaigns_text(study), plain("Written: " + ", ".join(map(str, files))))
    voice.hand_over(record)
    return _code(ended, alarm(study))


def _settings(one: Job, content: bytes) -> dict[str, Any]:
    """What a result depends on besides data and rig, this program's version among it; checks them, too."""
    if one.channels is not None:
        read_channel_map(one.channels)
    effects = effects_of(one.model)
    drawing = rig_before(parse_rig(content, one.rig), effects, one.rig)
    return {
        "model": one.model.value,
        "free": list(free_parameters(one.free, one.model, model_parameters(drawing, effects))),
        "max_frequency_hz": one.max_frequency,
        "fit": asdict(one.settings),
        "version": __version__,
    }


def _what_is_there(
    channels: Path | None,
    found: Sequence[Found],
    rig: bytes,
    settings: dict[str, Any],
    out: Path,
    progress: Progress,
) -> tuple[list[_Ended], list[_Pending]]:
    """The campaigns with a result from the same data, rig and settings, and the others."""
    ended, pending, others = [], [], 0
    for each in found:
        progress(f"looking at {each.name}")
        try:
            origin = made_from(each.path, channels, rig, settings)
        except (InputError, OSError) as error:
            told = error if isinstance(error, InputError) else f"{each.source}: {error.strerror or error}"
            ended.append(_Ended(_failed(each, one_line(told)), unreadable=True))
            continue
        kept = kept_result(out / each.name, origin.digest)
        if kept is None:
            pending.append(_Pending(each, origin))
            others += has_result(out / each.name)
        else:
            ended.append(_Ended(_fitted(each, kept, origin)))
    there = len(found) - len(pending) - sum(each.unreadable for each in ended)
    if there:
        progress(
            f"{_campaigns(there)} identified in an earlier run, from the same data, rig and settings: kept"
        )
    if others:
        progress(f"{_campaigns(others)} identified from other data, another rig or other settings: done anew")
    return ended, pending


def _task(job: ManyJob, pending: _Pending, rig: bytes) -> Task:
    path, channels = pending.found.path, job.one.channels
    if job.scheduler is not None:
        # Workers of a cluster run in other folders.
        path, channels = path.absolute(), None if channels is None else channels.absolute()
    one = replace(job.one, campaign=path, channels=channels)
    origin = pending.origin
    return Task(one, pending.found.source, rig, origin.data_sha256, origin.channels_sha256, __version__)


def _conclude(pending: _Pending, outcome: Outcome | Lost, out: Path) -> _Ended:
    """Keep a result; a campaign without one is a failed one."""
    if isinstance(outcome, Kept):
        keep_result(out / pending.found.name, outcome, pending.origin)
        return _Ended(_fitted(pending.found, outcome, pending.origin))
    unreadable = isinstance(outcome, Failure) and outcome.unreadable
    return _Ended(_failed(pending.found, one_line(outcome.reason)), unreadable)


def _fitted(found: Found, kept: Kept, origin: MadeFrom) -> CampaignRow:
    return row_of(found.name, found.source, kept.record, kept.start, origin.data_sha256)


def _failed(found: Found, reason: str) -> CampaignRow:
    return CampaignRow(found.name, found.source, RowStatus.failed, reason, None, None, {})


def _campaigns(count: int) -> str:
    return "1 campaign" if count == 1 else f"{count} campaigns"


def _code(ended: Sequence[_Ended], why_not: str) -> int:
    for each in ended:
        if each.row.status is RowStatus.failed:
            complain(f"Failed: {each.row.name}: {each.row.reason}")
        elif each.row.status is RowStatus.not_trusted:
            complain(f"Not to be trusted: {each.row.name}: {each.row.reason}.")
    if all(each.unreadable for each in ended):
        complain("Error: no campaign could be read. Remedy: mend what is said of each above.")
        return BAD_INPUT
    if not why_not:
        return OK
    complain(why_not)
    return NOT_TRUSTED
