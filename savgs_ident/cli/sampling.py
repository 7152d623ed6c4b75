"""From an identified model and a campaign to the posterior and its files."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from savgs_ident.cli.console import Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.models import effects_in, identified_in, rig_before
from savgs_ident.cli.reading import read_response
from savgs_ident.core.files import write_bytes
from savgs_ident.core.rig import read_rig
from savgs_ident.posterior.inference_data import write_inference_data
from savgs_ident.posterior.sample import Question, sample_posterior
from savgs_ident.posterior.settings import SamplingSettings
from savgs_ident.report.files import prepare_folder, write_json
from savgs_ident.report.origin import origin_of
from savgs_ident.report.posterior_html import posterior_html
from savgs_ident.report.posterior_record import posterior_record
from savgs_ident.report.posterior_text import posterior_text
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache

PACKAGES = ("jax", "emcee", "blackjax", "arviz-stats", "numpy", "scipy")
"""Whose version matters to a chain."""


@dataclass(frozen=True)
class Job:
    """What to sample from what. ``max_frequency`` [Hz] leaves out faster dwells."""

    model: Path
    campaign: Path
    channels: Path | None
    max_frequency: float | None
    settings: SamplingSettings
    resume: bool
    command: Sequence[str]


def sample(job: Job, voice: Voice, out: Path) -> int:
    """Sample, write posterior.nc, posterior.json and posterior.html to ``out``, and tell; the exit code."""
    prepare_folder(out)
    use_persistent_cache()
    rig = read_rig(job.model)
    effects = effects_in(rig, job.model)
    chain = out / f"chain-{job.settings.sampler}.h5"
    try:
        with voice.working() as progress:
            campaign, measured = read_response(
                job.campaign, job.channels, job.settings.orders, job.max_frequency, progress
            )
            free, values = identified_in(rig, effects, job.model)
            question = Question(measured, rig_before(rig, effects, job.model), values, effects, free)
            posterior = sample_posterior(question, job.settings, chain, job.resume, progress)
            progress("writing")
            origin = origin_of(campaign, job.model, job.command, PACKAGES, measured.warnings)
            record = posterior_record(posterior, origin)
            files = [
                write_inference_data(posterior, out / "posterior.nc"),
                write_json(out / "posterior.json", record),
                write_bytes(out / "posterior.html", posterior_html(posterior, origin).encode()),
            ]
    except KeyboardInterrupt:
        if chain.exists():
            complain(f"The chain so far is in {chain}: the same command with --resume goes on from there.")
        raise
    voice.show(posterior_text(posterior), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if posterior.convergence.converged:
        return OK
    complain(f"Not to be trusted: {'; '.join(posterior.convergence.reasons)}.")
    return NOT_TRUSTED
