"""One campaign of many, identified by itself, in whichever process and on whichever machine: texts in, texts out."""

from dataclasses import dataclass, replace

from threadpoolctl import threadpool_limits

from savgs_ident import __version__
from savgs_ident.cli.campaign_store import Kept
from savgs_ident.cli.console import Progress
from savgs_ident.cli.identify import Job, fit_campaign, identified_rig
from savgs_ident.core.errors import InputError
from savgs_ident.core.files import spelled_out
from savgs_ident.core.rig import parse_rig, rig_text
from savgs_ident.recordings.read import map_digest
from savgs_ident.report.files import to_json
from savgs_ident.report.fit_record import fit_record
from savgs_ident.simulate.compilation import (
    compute_on_one_core,
    make_room_for_programs,
    use_persistent_cache,
)


@dataclass(frozen=True)
class Task:
    """A campaign to identify.

    Attributes:
        job: what, as for ``fit``.
        source: what to call the campaign.
        rig: content of the rig file when the run began; its path in ``job`` is only its name.
        data_sha256: digest of the recordings when the run began.
        channels_sha256: the same of the map of their channels, None if there was none.
        version: of this package where the run began.
    """

    job: Job
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


Outcome = Kept | Failure
"""What becomes of a campaign."""


def identify_one(task: Task) -> Outcome:
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


def _identified(task: Task) -> Kept:
    if task.version != __version__:
        raise InputError(
            f"a worker has version {__version__} of savgs-ident, the run began with {task.version}",
            source=task.source,
            remedy="install the same version for every worker",
        )
    campaign, fit = fit_campaign(task.job, parse_rig(task.rig, task.job.rig), Progress(None, None))
    if campaign.sha256 != task.data_sha256:
        raise InputError(
            "is not what it was when the run began",
            source=task.source,
            remedy="let the recording end, and run again",
        )
    if map_digest(task.job.campaign, task.job.channels) != task.channels_sha256:
        raise InputError(
            "the map of its channels is not what it was when the run began",
            source=task.source,
            remedy="run again",
        )
    record = fit_record(fit, (*campaign.warnings, *fit.measured.warnings))
    named = replace(campaign, source=task.source)
    return Kept(to_json(record), rig_text(identified_rig(fit, named, task.job)), campaign.start)
