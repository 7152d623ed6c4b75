"""From a campaign to its diagnosis and the files of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from savgs_ident.cli.console import Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.models import (
    ModelName,
    effects_in,
    effects_of,
    free_parameters,
    identified_in,
    rig_before,
)
from savgs_ident.cli.reading import first_sweep, read_response
from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import Rig, default_rig_path, read_rig
from savgs_ident.diagnose.diagnose import diagnose_response
from savgs_ident.diagnose.settings import DiagnosisSettings
from savgs_ident.report.diagnosis_files import write_diagnosis
from savgs_ident.report.diagnosis_record import diagnosis_record
from savgs_ident.report.diagnosis_text import diagnosis_text
from savgs_ident.report.files import prepare_folder
from savgs_ident.report.origin import origin_of
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache

PACKAGES = ("jax", "numpy", "scipy")
"""Whose version matters to a diagnosis."""


@dataclass(frozen=True)
class Job:
    """What to diagnose from what. ``max_frequency`` [Hz] leaves out faster dwells."""

    campaign: Path
    channels: Path | None
    rig: Path | None
    model: ModelName | None
    without: tuple[str, ...]
    max_frequency: float | None
    orders: int
    command: Sequence[str]


def run_diagnosis(job: Job, voice: Voice, out: Path) -> int:
    """Diagnose, write diagnosis.json and diagnosis.html to ``out``, and tell; the exit code."""
    prepare_folder(out)
    use_persistent_cache()
    source = job.rig or default_rig_path()
    rig, settings, values = baseline_of(read_rig(source), job, source)
    with voice.working() as progress:
        campaign, measured = read_response(
            job.campaign, job.channels, job.orders, job.max_frequency, progress
        )
        sweep = first_sweep(campaign)
        diagnosis = diagnose_response(measured, rig, settings, values, progress, sweep)
        progress("writing")
        origin = origin_of(campaign, source, job.command, PACKAGES, measured.warnings)
        files = write_diagnosis(diagnosis, origin, out)
    voice.show(diagnosis_text(diagnosis), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(diagnosis_record(diagnosis, origin))
    if diagnosis.converged:
        return OK
    complain("Not to be trusted: " + " ".join(diagnosis.warnings))
    return NOT_TRUSTED


def baseline_of(rig: Rig, job: Job, source: object) -> tuple[Rig, DiagnosisSettings, Mapping[str, float]]:
    """The rig as known before its own fit, what the baseline is, and the values that it is given with [SI].

    Raises :class:`InputError` for an identified rig of another model than the job asks for.
    """
    if "effects" not in rig.provenance:
        model = job.model or ModelName.simtr
        free = free_parameters((), model, rig.parameters)
        settings = DiagnosisSettings(model.value, effects_of(model), free, job.orders, job.without)
        return rig, settings, {}
    effects = effects_in(rig, source)
    if job.model is not None and set(effects_of(job.model)) != set(effects):
        raise InputError(
            f"was identified with {', '.join(effects) or 'no friction'}, which is not {job.model.value}",
            source=source,
            remedy="leave --model out, or give the drawing that the rig was identified from",
        )
    free, values = identified_in(rig, effects, source)
    settings = DiagnosisSettings(rig.name, effects, free, job.orders, job.without)
    return rig_before(rig, effects, source), settings, values
