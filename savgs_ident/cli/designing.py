"""From a rig file to a controller and the files of it."""

from dataclasses import dataclass
from pathlib import Path

from savgs_ident.cli.console import Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.models import ModelName, rig_and_effects
from savgs_ident.control.controller_file import controller_record
from savgs_ident.control.design import design_controller
from savgs_ident.control.rigs import Rigs, rigs_from_covariance, rigs_from_posterior
from savgs_ident.control.weights import DEFAULT_WEIGHTS, read_weights
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.model.values import as_values
from savgs_ident.report.design_figures import design_figures
from savgs_ident.report.design_html import design_html
from savgs_ident.report.design_record import design_record
from savgs_ident.report.design_text import design_text
from savgs_ident.report.design_words import alarm
from savgs_ident.report.files import prepare_folder, write_bytes, write_json
from savgs_ident.report.model_origin import model_origin
from savgs_ident.report.picture import write_figure
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache


@dataclass(frozen=True)
class Job:
    """What to design for what: see the options of the command; ``rate`` [Hz]."""

    rig: Path
    model: ModelName | None
    weights: Path | None
    posterior: Path | None
    rigs: int
    order: int | None
    rate: float
    command: tuple[str, ...]


def run_design(job: Job, voice: Voice, out: Path) -> int:
    """Design, write the files to ``out``, and tell; the exit code."""
    prepare_folder(out)
    rig, effects = rig_and_effects(job.rig, job.model)
    weights = DEFAULT_WEIGHTS if job.weights is None else read_weights(job.weights)
    table = model_parameters(rig, effects)
    others = _rigs(job, rig, table)
    use_persistent_cache()
    with voice.working() as progress:
        p = as_values(table.as_dict())
        design = design_controller(
            build_model(rig, effects), p, others, weights, progress, job.order, job.rate
        )
        origin = model_origin(rig.name, job.rig, effects, job.command)
        files = [write_json(out / "controller.json", controller_record(design.digital))]
        record = design_record(design, origin)
        files.append(write_json(out / "design.json", record))
        progress("drawing")
        for stem, figure in design_figures(design).items():
            files += write_figure(out, stem, figure)
        progress("writing the report")
        files.append(write_bytes(out / "design.html", design_html(design, origin).encode()))
    voice.show(design_text(record), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if design.trusted:
        return OK
    complain(f"Not to be trusted: {alarm(design)}")
    return NOT_TRUSTED


def _rigs(job: Job, rig: Rig, table: ParameterTable) -> Rigs:
    """What the controller is tried on."""
    if job.posterior is not None:
        return rigs_from_posterior(table, job.posterior, job.rigs)
    return rigs_from_covariance(table, rig.provenance, job.rigs, job.rig)
