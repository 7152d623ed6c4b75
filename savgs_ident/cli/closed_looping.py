"""From a rig file and a controller to a closed-loop study and its files."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.models import ModelName, rig_and_effects
from savgs_ident.control.closed_loop.programme import (
    DEFAULT_SPEED,
    LoopKind,
    LoopTest,
    bump_test,
    harmonic_test,
    iso_test,
    sweep_test,
)
from savgs_ident.control.closed_loop.study import LoopStudy, study_loop
from savgs_ident.control.controller_file import DigitalController, read_controller
from savgs_ident.control.design import controller_for
from savgs_ident.control.rigs import Rigs, rigs_from_covariance, rigs_from_posterior
from savgs_ident.control.weights import DEFAULT_WEIGHTS
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values
from savgs_ident.report.files import prepare_folder, write_bytes, write_json, write_table
from savgs_ident.report.loop_figures import causes_figure, failures_figure, loop_figure, rigs_figure
from savgs_ident.report.loop_html import loop_html
from savgs_ident.report.loop_record import loop_columns, loop_record
from savgs_ident.report.loop_text import loop_text
from savgs_ident.report.loop_words import alarm
from savgs_ident.report.model_origin import ModelOrigin, model_origin
from savgs_ident.report.picture import write_figure
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache


@dataclass(frozen=True)
class Job:
    """What to run on what; ``speed`` in [m/s], the test's own if None; ``rigs`` how many others."""

    rig: Path
    model: ModelName | None
    test: str
    frequency: float
    road: str
    speed: float | None
    controller: Path | None
    posterior: Path | None
    rigs: int
    causes: bool
    command: tuple[str, ...]


def close_loop(job: Job, voice: Voice, out: Path) -> int:
    """Run the study, write closed-loop.json, .csv, .html and pictures to ``out``, and tell; the exit code."""
    prepare_folder(out)
    use_persistent_cache()
    rig, effects = rig_and_effects(job.rig, job.model)
    table = model_parameters(rig, effects)
    model, p = build_model(rig, effects), as_values(table.as_dict())
    rigs = _rigs(job, table, rig.provenance)
    with voice.working() as progress:
        controller, told = _controller(job, model, p, progress)
        study = study_loop(model, p, controller, _test(job, p), progress, rigs, job.causes)
        origin = model_origin(rig.name, job.rig, effects, job.command)
        record = loop_record(study, origin, told)
        files = [
            write_json(out / "closed-loop.json", record),
            write_table(out / "closed-loop.csv", loop_columns(study)),
        ]
        progress("drawing")
        files += _draw(study, p, origin, told, out)
    voice.show(loop_text(study), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if study.trusted:
        return OK
    complain(f"Not to be trusted: {alarm(study)}")
    return NOT_TRUSTED


def _rigs(job: Job, table: ParameterTable, provenance: Mapping[str, object]) -> Rigs | None:
    if job.rigs == 0:
        return None
    if job.posterior is not None:
        return rigs_from_posterior(table, job.posterior, job.rigs)

    return rigs_from_covariance(table, provenance, job.rigs, job.rig)


def _controller(job: Job, model: QuarterCar, p: Values, progress: Progress) -> tuple[DigitalController, str]:
    """The controller, and which one it is in words."""
    if job.controller is not None:
        return read_controller(job.controller), str(job.controller)
    progress("H-infinity synthesis with the default weights")
    return controller_for(model, p, DEFAULT_WEIGHTS), "designed for this rig with the default weights"


def _test(job: Job, p: Values) -> LoopTest:
    cam, name = float(p["cam_peak_to_peak"]), LoopKind(job.test)
    if name is LoopKind.harmonic:
        return harmonic_test(cam, job.frequency)
    if name is LoopKind.sweep:
        return sweep_test(cam)
    speed = DEFAULT_SPEED[name] if job.speed is None else job.speed
    return iso_test(job.road, speed) if name is LoopKind.iso else bump_test(speed)


def _draw(study: LoopStudy, p: Values, origin: ModelOrigin, told: str, out: Path) -> list[Path]:
    files = [*write_figure(out, "closed-loop", loop_figure(study, p))]
    files += write_figure(out, "failures", failures_figure(study))
    if study.on_rigs:
        files += write_figure(out, "rigs", rigs_figure(study))
    if study.causes:
        files += write_figure(out, "causes", causes_figure(study))
    page = loop_html(study, p, origin, told)
    return [*files, write_bytes(out / "closed-loop.html", page.encode())]
