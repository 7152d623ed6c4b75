"""From a rig file to its linear models and the files of them."""

from dataclasses import dataclass
from pathlib import Path

from savgs_ident.cli.console import Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.models import ModelName, rig_and_effects
from savgs_ident.control.linear_study import study_linear
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.model.values import as_values
from savgs_ident.report.files import prepare_folder, write_bytes, write_json
from savgs_ident.report.linear_figures import linear_figures
from savgs_ident.report.linear_html import linear_html
from savgs_ident.report.linear_record import linear_record
from savgs_ident.report.linear_text import linear_text
from savgs_ident.report.linear_words import alarm
from savgs_ident.report.model_origin import model_origin
from savgs_ident.report.picture import write_figure
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache


@dataclass(frozen=True)
class Job:
    """What to linearise: a rig file, with the effects of a ``model`` or else its own."""

    rig: Path
    model: ModelName | None
    command: tuple[str, ...]


def run_linearisation(job: Job, voice: Voice, out: Path) -> int:
    """Linearise, write the files to ``out``, and tell; the exit code."""
    prepare_folder(out)
    rig, effects = rig_and_effects(job.rig, job.model)
    use_persistent_cache()
    with voice.working() as progress:
        p = as_values(model_parameters(rig, effects).as_dict())
        study = study_linear(build_model(rig, effects), p, progress)
        origin = model_origin(rig.name, job.rig, effects, job.command)
        record = linear_record(study, origin)
        files = [write_json(out / "linearise.json", record)]
        progress("drawing")
        for stem, figure in linear_figures(study).items():
            files += write_figure(out, stem, figure)
        progress("writing the report")
        files.append(write_bytes(out / "linearise.html", linear_html(study, origin).encode()))
    voice.show(linear_text(record), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if study.trusted:
        return OK
    complain(f"Not to be trusted: {alarm(study)}")
    return NOT_TRUSTED
