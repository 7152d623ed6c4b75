"""From a rig file, a posterior and a diagnosis to the files that other tools read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from savgs_ident.cli.console import Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.models import ModelName, effects_in, effects_of
from savgs_ident.core.errors import InputError, SavgsIdentError, blamed_on
from savgs_ident.core.rig import Rig, read_rig
from savgs_ident.export.diagnosis_document import REMEDY, read_diagnosis
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.gather import Gathered, gather
from savgs_ident.export.registry import EXPORTS
from savgs_ident.export.rig_document import covariance_record
from savgs_ident.report.export_record import export_record, export_text
from savgs_ident.report.files import prepare_folder, write_json
from savgs_ident.report.model_origin import model_origin
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache


@dataclass(frozen=True)
class Job:
    """What to export in which formats: see the options of the command."""

    rig: Path
    formats: tuple[str, ...]
    posterior: Path | None
    samples: int
    diagnosis: Path | None
    model: ModelName | None
    command: tuple[str, ...]


def run_export(job: Job, voice: Voice, out: Path) -> int:
    """Export, write the files to ``out``, and tell; the exit code."""
    _check_formats(job.formats)
    prepare_folder(out)
    rig = read_rig(job.rig)
    gathered = gathered_for(job, rig)
    model = gathered.model
    _check_covariance(model, job.rig)
    use_persistent_cache()
    written = {}
    with voice.working() as progress:
        for name in job.formats:
            progress(f"writing {name}")
            # What names no file of its own is a fault of the rig's numbers.
            with blamed_on(job.rig):
                written[name] = _write(name, model, out)
    origin = model_origin(rig.name, job.rig, model.effects, job.command)
    record = export_record(gathered, written, origin)
    file = write_json(out / "export.json", record)
    voice.show(export_text(record), plain(f"Written: {file}"))
    voice.hand_over(record)
    if not gathered.doubts:
        return OK
    complain("Not to be trusted: " + " ".join(gathered.doubts))
    return NOT_TRUSTED


def gathered_for(job: Job, rig: Rig) -> Gathered:
    """The model of a rig with what the job's other files say of it.

    Raises :class:`InputError` for a file that cannot be used, or two that do not belong together.
    """
    diagnosis = {} if job.diagnosis is None else read_diagnosis(job.diagnosis)
    effects = _effects(job, rig, diagnosis)
    try:
        return gather(rig, effects, diagnosis, job.posterior, job.samples)
    except InputError as error:
        # What has no source is a fault of the diagnosis: the rig has been read, and draws name their file.
        raise InputError(
            error.what, source=error.source or job.diagnosis, remedy=error.remedy or REMEDY
        ) from None


def _effects(job: Job, rig: Rig, diagnosis: Mapping[str, Any]) -> tuple[str, ...]:
    """The effects asked for, or else the rig file's own, or else, for a drawing, those that were diagnosed."""
    if job.model is not None:
        return effects_of(job.model)
    baseline = diagnosis.get("baseline", {}).get("effects")
    if "effects" in rig.provenance or baseline is None:
        return effects_in(rig, job.rig)
    return tuple(baseline)


def _check_formats(formats: Sequence[str]) -> None:
    for name in formats:
        if name not in EXPORTS:
            raise InputError(
                f"there is no format '{name}'", source="--to", remedy="choose among: " + ", ".join(EXPORTS)
            )


def _check_covariance(model: ExportedModel, source: Path) -> None:
    try:
        covariance_record(model)
    except InputError as error:
        raise InputError(error.what, source=source, remedy="identify the rig again") from None


def _write(name: str, model: ExportedModel, out: Path) -> tuple[Path, ...]:
    try:
        return EXPORTS[name].write(model, out)
    except InputError:
        raise
    except SavgsIdentError as error:
        # An effect whose law the format cannot hold.
        raise InputError(str(error), source=f"--to {name}", remedy="leave this format out") from error
