"""Many campaigns: found, those without a result identified side by side, each saved at once, and all put together.

    study = run_campaigns(["recordings/"], "out/campaign", free=("mu_r", "c_sd"))
    print(study.trends["mu_r"].line)

A campaign is identified by itself, in whichever process and on whichever machine: texts in, texts out
(:func:`identify_one`). What becomes of it is saved before the next one is waited for, so that a run that was stopped
goes on where it was.
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial, reduce
from operator import add
from pathlib import Path
from typing import Any, cast

from threadpoolctl import threadpool_limits

from savgs_ident import __version__
from savgs_ident.campaigns.store import (
    Found,
    MadeFrom,
    StoredResult,
    check_apart,
    find_campaigns,
    forget_parts,
    has_result,
    in_natural_order,
    load_result,
    made_from,
    save_result,
)
from savgs_ident.campaigns.study import CampaignRow, CampaignStudy, RowStatus, row_of, study_campaigns
from savgs_ident.core.errors import InputError
from savgs_ident.core.executor import Lost, compute_on_one_core, cores, run_tasks
from savgs_ident.core.files import prepare_folder, spelled_out
from savgs_ident.core.presentation import Origin, Progress, no_progress
from savgs_ident.fit.least_squares import FitSettings
from savgs_ident.fit.public import fit
from savgs_ident.plants.from_file import load_plant
from savgs_ident.plants.model import Model, PlantModel
from savgs_ident.plants.model_toml import model_text, parse_model
from savgs_ident.plants.parameter_toml import file_content
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import default_rig_path, parse_rig, rig_text
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.channels import read_channel_map
from savgs_ident.recordings.read import campaign_files, digest_files, map_digest
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.responses.recorded_motion import is_motion, load_motion
from savgs_ident.simulate.program_cache import make_room_for_programs, use_persistent_cache

QUARTER_CAR = "quarter_car"
"""The plant that a run is about where none is named."""

FILE_NAMES = (
    "campaign.json", "campaigns.csv", "campaigns.parquet", "campaign.png", "campaign.pdf", "campaign.html"
)  # fmt: skip
"""The files of a study, which no campaign may be named like."""


@dataclass(frozen=True)
class FitRequest:
    """A campaign to identify, and how.

    Attributes:
        campaign: its file or folder.
        plant: "quarter_car", or what :func:`~savgs_ident.plants.from_file.load_plant` takes.
        rig: the rig file, or another plant's file of numbers; None for what the plant declares.
        channels: the map of the campaign's channels.
        model: "simtr" or "simqc", of the quarter car.
        beside: names of the effects that the model has besides.
        free: parameters to identify; the paper's if empty.
        settings: of the fit.
        max_frequency: leave out faster dwells [Hz].
        command: the command line, for the provenance.
    """

    campaign: Path
    plant: str
    rig: Path | None
    channels: Path | None
    model: str
    beside: tuple[str, ...]
    free: tuple[str, ...]
    settings: FitSettings
    max_frequency: float | None
    command: tuple[str, ...]

    def model_of(self, rig: bytes) -> Model:
        """The model, with ``rig`` in the file of its numbers; raises :class:`InputError` if that is none."""
        if self.plant == QUARTER_CAR:
            return reduce(add, self.beside, RigModel(parse_rig(rig, self.rig), MODELS[self.model]))
        declared = load_plant(self.plant)
        start = declared if self.rig is None else parse_model(rig, self.rig, declared)
        return reduce(add, self.beside, start)


@dataclass(frozen=True)
class CampaignTask:
    """A campaign to identify as it was when the run began.

    Attributes:
        request: what.
        source: what to call the campaign.
        rig: content of the rig file when the run began; its path in ``request`` is only its name.
        data_sha256: digest of the recordings when the run began.
        channels_sha256: the same of the map of their channels, None if there was none.
        version: of this package where the run began.
    """

    request: FitRequest
    source: str
    rig: bytes
    data_sha256: str
    channels_sha256: str | None
    version: str


@dataclass(frozen=True)
class Failure:
    """No result, and why, in one line; ``unreadable`` if the campaign itself could not be used."""

    reason: str
    unreadable: bool = False


Outcome = StoredResult | Failure
"""What becomes of a campaign."""

Work = Callable[[CampaignTask], Outcome]
Spread = Callable[[Work, Sequence[CampaignTask]], Generator[tuple[int, Outcome | Lost]]]
"""Does the work on all tasks; gives their numbers and results as they come."""


@dataclass(frozen=True)
class CampaignRun:
    """What to identify: ``one`` says how each, its campaign left open; ``arguments`` where they are."""

    arguments: tuple[Path, ...]
    one: FitRequest
    scheduler: str | None
    workers: int


def run_campaigns(
    folders: str | Path | Sequence[str | Path],
    out: str | Path,
    *,
    plant: str = QUARTER_CAR,
    rig: str | Path | None = None,
    model: str = "simtr",
    beside: Sequence[str] = (),
    free: Sequence[str] = (),
    channels: str | Path | None = None,
    orders: int = 9,
    fixed_tolerances: bool = False,
    max_frequency: float | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> CampaignStudy:
    """Identify many campaigns side by side, and say whether the parameters agree and whether they change.

    Args:
        folders: campaigns as :func:`~savgs_ident.plants.quarter_car.rig_recordings.load_campaign` takes them, and
            folders of several: one in each file or subfolder.
        out: folder in which each campaign's result is saved; a run that was stopped goes on from there.
        plant: "quarter_car", or what :func:`~savgs_ident.plants.from_file.load_plant` takes: "FILE.py:CLASS".
        rig: rig file to start from, the shipped one if left out; a ``model.toml`` of another plant.
        model: "simtr", with rail and tyre friction, or "simqc", without: of the quarter car.
        beside: names of effects that the model has besides, as a diagnosis names them.
        free: names of the parameters to identify; the paper's if empty.
        channels: the map of the channels.
        orders: highest harmonic order to fit.
        fixed_tolerances: hold what is known to a tolerance at its value.
        max_frequency: leave out faster dwells [Hz].
        workers: campaigns at a time on this machine, each on one core; as many as there are cores if left out.
        scheduler: address of a Dask cluster to work on instead.
        command: what the results say that they were made by.
        progress: called with a sentence on what is being done.

    A campaign that fails is a row that says why, the others go on. Raises :class:`InputError` for what concerns all:
    an argument, the rig, the settings, the folder, the cluster.
    """
    numbers = None if rig is None else Path(rig)
    one = FitRequest(
        Path(),
        plant,
        numbers or (default_rig_path() if plant == QUARTER_CAR else None),
        None if channels is None else Path(channels),
        model,
        tuple(beside),
        tuple(free),
        FitSettings(orders=orders, fixed_tolerances=fixed_tolerances),
        max_frequency,
        tuple(command),
    )
    given = [folders] if isinstance(folders, str | Path) else folders
    run = CampaignRun(tuple(map(Path, given)), one, scheduler, workers or cores())
    return identify_all(run, identify_one, spread_of(run), Path(out), progress)


def spread_of(run: CampaignRun) -> Spread:
    """The executor with what the run says of it."""
    return partial(run_tasks, workers=run.workers, scheduler=run.scheduler)


def identify_all(
    run: CampaignRun, work: Work, spread: Spread, out: Path, progress: Progress = no_progress
) -> CampaignStudy:
    """Identify what has no result in the folder ``out`` yet, and put all together.

    ``work`` makes the result of a task and ``spread`` does it on all, see :func:`spread_of`. Raises as
    :func:`run_campaigns` does.
    """
    # As it is now: a change during the run concerns no campaign.
    rig = b"" if run.one.rig is None else file_content(run.one.rig)
    settings = _settings(run.one, rig)
    found = find_campaigns(run.arguments, FILE_NAMES)
    check_apart(out, run.arguments, found, FILE_NAMES)
    prepare_folder(out)
    forget_parts(out, FILE_NAMES)
    rows, pending = _what_is_there(run.one.channels, found, rig, settings, out, progress)
    if pending:
        progress(f"identifying {_campaigns(len(pending))}")
        with closing(spread(work, [_task(run, each, rig) for each in pending])) as outcomes:
            for number, outcome in outcomes:
                rows.append(_conclude(pending[number], outcome, out))
                progress(f"{len(rows)} of {len(found)} done; {rows[-1]}")
    return study_campaigns(rows, in_natural_order, settings, Origin(command=run.one.command))


def identify_one(task: CampaignTask) -> Outcome:
    """Fit the campaign; whatever goes wrong with it is its result and ends nothing else."""
    try:
        # There are as many of these as there are cores.
        compute_on_one_core()
        use_persistent_cache()
        make_room_for_programs()
        with threadpool_limits(1, "blas"):
            return _identified(task)
    except InputError as error:
        return Failure(one_line(error), unreadable=True)
    except OSError as error:
        return Failure(one_line(f"{task.source}: {error.strerror or error}"), unreadable=True)
    except Exception as error:
        return Failure(one_line(f"{type(error).__name__}: {error}"))


def one_line(text: object) -> str:
    """``text`` in one line that can be written anywhere."""
    return spelled_out(" ".join(str(text).split()))


def _identified(task: CampaignTask) -> StoredResult:
    if task.version != __version__:
        raise InputError(
            f"a worker has version {__version__} of savgs-ident, the run began with {task.version}",
            source=task.source,
            remedy="install the same version for every worker",
        )
    request = task.request
    model = request.model_of(task.rig)
    measured, start, digest = _recorded(request, model, task.source)
    if digest != task.data_sha256:
        raise InputError(
            "is not what it was when the run began",
            source=task.source,
            remedy="let the recording end, and run again",
        )
    if map_digest(request.campaign, request.channels) != task.channels_sha256:
        raise InputError(
            "the map of its channels is not what it was when the run began",
            source=task.source,
            remedy="run again",
        )
    found = fit(
        model,
        measured,
        request.free,
        orders=request.settings.orders,
        fixed_tolerances=request.settings.fixed_tolerances,
        max_frequency=request.max_frequency,
        command=request.command,
    )
    identified = found.model
    text = (
        rig_text(identified.rig)
        if isinstance(identified, RigModel)
        else model_text(cast(PlantModel, identified))
    )
    return StoredResult(found.to_json(), text, start)


def _recorded(
    request: FitRequest, model: Model, source: str
) -> tuple[Campaign | DrivenMotion, float | None, str]:
    """What was recorded, when it began [s since 1970, UTC] where that is known, and its digest."""
    # The worker of a cluster has it under another path than ``source``.
    if is_motion(request.campaign):
        motion = replace(load_motion(request.campaign), source=source)
        return motion, None, digest_files(campaign_files(request.campaign))
    campaign = load_campaign(request.campaign, request.channels, layout=model.layout)
    return replace(campaign, source=source), campaign.start, campaign.sha256


@dataclass(frozen=True)
class _Pending:
    """A campaign without a result, and what its result will be made from."""

    found: Found
    origin: MadeFrom


def _settings(one: FitRequest, content: bytes) -> dict[str, Any]:
    """What a result depends on besides data and rig, this program's version among it; checks them, too."""
    model = one.model_of(content)
    if one.channels is not None:
        read_channel_map(one.channels, model.layout)
    of = (
        {"model": one.model}
        if one.plant == QUARTER_CAR
        else {"plant": one.plant, "plant_sha256": model.sha256}
    )
    return {
        **of,
        "with": list(one.beside),
        "free": list(model.before.free(one.free)),
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
) -> tuple[list[CampaignRow], list[_Pending]]:
    """The campaigns with a result from the same data, rig and settings, and the others."""
    rows, pending, others = [], [], 0
    for each in found:
        progress(f"looking at {each.name}")
        try:
            origin = made_from(each.path, channels, rig, settings)
        except (InputError, OSError) as error:
            message = error if isinstance(error, InputError) else f"{each.source}: {error.strerror or error}"
            rows.append(_failed(each, one_line(message), unreadable=True))
            continue
        stored = load_result(out / each.name, origin.digest)
        if stored is None:
            pending.append(_Pending(each, origin))
            others += has_result(out / each.name)
        else:
            rows.append(_fitted(each, stored, origin))
    there = len(found) - len(pending) - sum(each.unreadable for each in rows)
    if there:
        progress(
            f"{_campaigns(there)} identified in an earlier run, from the same data, rig and settings: kept"
        )
    if others:
        progress(f"{_campaigns(others)} identified from other data, another rig or other settings: done anew")
    return rows, pending


def _task(run: CampaignRun, pending: _Pending, rig: bytes) -> CampaignTask:
    path, channels = pending.found.path, run.one.channels
    if run.scheduler is not None:
        # Workers of a cluster run in other folders.
        path, channels = path.absolute(), None if channels is None else channels.absolute()
    one = replace(run.one, campaign=path, channels=channels)
    origin = pending.origin
    return CampaignTask(
        one, pending.found.source, rig, origin.data_sha256, origin.channels_sha256, __version__
    )


def _conclude(pending: _Pending, outcome: Outcome | Lost, out: Path) -> CampaignRow:
    """Save a result; a campaign without one is a failed one."""
    if isinstance(outcome, StoredResult):
        save_result(out / pending.found.name, outcome, pending.origin)
        return _fitted(pending.found, outcome, pending.origin)
    unreadable = isinstance(outcome, Failure) and outcome.unreadable
    return _failed(pending.found, one_line(outcome.reason), unreadable)


def _fitted(found: Found, stored: StoredResult, origin: MadeFrom) -> CampaignRow:
    return row_of(found.name, found.source, stored.record, stored.start, origin.data_sha256)


def _failed(found: Found, reason: str, unreadable: bool) -> CampaignRow:
    return CampaignRow(
        found.name, found.source, RowStatus.failed, reason, None, None, {}, unreadable=unreadable
    )


def _campaigns(count: int) -> str:
    return "1 campaign" if count == 1 else f"{count} campaigns"
