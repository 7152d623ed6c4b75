"""From a campaign to an identified rig and its files: what ``fit`` and ``demo`` have in common.

Each result is written as soon as it is there, so that stopping during the pictures keeps the fit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from savgs_ident.cli.compare import draw_comparison
from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.models import ModelName, effects_of, free_parameters, rig_before
from savgs_ident.cli.reading import read_response
from savgs_ident.core.rig import Rig, read_rig, write_rig
from savgs_ident.core.status import Status
from savgs_ident.effects.registry import model_parameters
from savgs_ident.fit.least_squares import fit_least_squares
from savgs_ident.fit.result import Fit
from savgs_ident.fit.settings import FitSettings
from savgs_ident.recordings.recording import Campaign
from savgs_ident.report.bode_record import Compared
from savgs_ident.report.files import prepare_folder, write_json
from savgs_ident.report.fit_record import fit_record
from savgs_ident.report.fit_text import fit_text
from savgs_ident.report.provenance import provenance
from savgs_ident.report.solving import Solved
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache
from savgs_ident.simulate.measured import measured_excitation


@dataclass(frozen=True)
class Job:
    """What to identify from what; ``free`` empty means the paper's parameters.

    ``max_frequency`` [Hz] leaves out faster dwells.
    """

    campaign: Path
    rig: Path
    channels: Path | None
    model: ModelName
    free: tuple[str, ...]
    settings: FitSettings
    max_frequency: float | None
    command: Sequence[str]


def identify(job: Job, voice: Voice, out: Path) -> int:
    """Fit, write fit.json, model.toml, bode.png and bode.pdf to ``out``, and tell; the exit code."""
    prepare_folder(out)
    use_persistent_cache()
    rig = read_rig(job.rig)
    with voice.working() as progress:
        campaign, fit = fit_campaign(job, rig, progress)
        record = fit_record(fit, (*campaign.warnings, *fit.measured.warnings))
        files = [write_json(out / "fit.json", record), out / "model.toml"]
        identified = identified_rig(fit, campaign, job)
        write_rig(identified, out / "model.toml")
        files += _draw(fit, identified, campaign.source, out, progress)
    voice.show(fit_text(fit), plain(""), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    return conclude(fit)


def fit_campaign(job: Job, rig: Rig, progress: Progress) -> tuple[Campaign, Fit]:
    """Read the campaign of a job and fit ``rig``, what is in its file, to it.

    Raises :class:`InputError` for a campaign that cannot be used and for unknown parameters.
    """
    effects = effects_of(job.model)
    # A rig that was identified before brings what was known then; its values would count the data twice.
    drawing = rig_before(rig, effects, job.rig)
    free = free_parameters(job.free, job.model, model_parameters(drawing, effects))
    campaign, measured = read_response(
        job.campaign, job.channels, job.settings.orders, job.max_frequency, progress
    )
    fit = fit_least_squares(
        measured, drawing, effects=effects, free=free, settings=job.settings, progress=progress
    )
    return campaign, fit


def identified_rig(fit: Fit, campaign: Campaign, job: Job) -> Rig:
    """What a fit identified, with its provenance: the content of ``model.toml``."""
    return replace(fit.rig, provenance=provenance(fit, campaign, job.command))


def _draw(fit: Fit, rig: Rig, source: str, out: Path, progress: Progress) -> tuple[Path, ...]:
    excitation = measured_excitation(fit.measured, rig.parameters["psi_nominal"].value)
    model = Solved(excitation, fit.predicted, fit.dwell_status)
    status = tuple(
        Status.CONVERGED if np.isfinite(each).all() else Status.STALLED for each in fit.frictionless
    )
    frictionless = Solved(excitation, fit.frictionless, status)
    compared = Compared(fit.measured, model, frictionless, fit.used)
    return draw_comparison(rig, fit.effects, compared, source, out, progress)


def conclude(fit: Fit) -> int:
    """The exit code of a fit; says on standard error why one is not to be trusted."""
    if fit.trusted:
        return OK
    if not fit.status.ok:
        reason = fit.status.advice
    elif not all(status.ok for status in fit.dwell_status):
        reason = "the model's periodic motion was not found in every dwell"
    else:
        reason = "the data cannot tell every free parameter"
    complain(f"Not to be trusted: {reason}.")
    return NOT_TRUSTED
