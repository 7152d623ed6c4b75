"""What ``import savgs_ident`` offers of inference: the posterior of what was identified."""

from dataclasses import replace
from pathlib import Path

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.fit.posterior_advice import describe_posterior
from savgs_ident.fit.result import Fit
from savgs_ident.inference.result import Posterior, Sampler
from savgs_ident.inference.sample import Question, sample_posterior
from savgs_ident.inference.samplers.chains import SamplingSettings
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import Measurements, campaign_of, measured_response
from savgs_ident.simulate.program_cache import use_persistent_cache


def sample(
    identified: Fit | Model,
    measured: Measurements | None = None,
    sampler: Sampler = "emcee",
    *,
    target_ess: float = 1000.0,
    time_limit: float = 600.0,
    patience: float = 85.0,
    fixed_tolerances: bool = False,
    max_frequency: float | None = None,
    orders: int = 9,
    seed: int = 1,
    chain: str | Path | None = None,
    resume: bool = False,
    progress: Progress = no_progress,
) -> Posterior:
    """Sample the posterior of the parameters that a fit identified: intervals, trade-offs, predictions.

    Tolerances are marginalised over, the noise's scale and the model's discrepancy estimated along.

    Args:
        identified: a fit, or a model that was identified.
        measured: the recordings, or the response of their dwells; what was fitted, if left out.
        sampler: "emcee", an ensemble of walkers, or "nuts", gradient-based trajectories.
        target_ess: effective sample size to reach for every parameter [1].
        time_limit: stop sampling after this [s].
        patience: go on beyond the target up to this [s], for medians to a fortieth of their standard deviation.
        fixed_tolerances: hold what is known to a tolerance at its value.
        max_frequency: leave out faster dwells [Hz].
        orders: highest harmonic order to compare.
        seed: of all random numbers.
        chain: file in which the chain is kept after every step.
        resume: go on with the chain that is there.
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` for a model without campaign, a campaign that cannot
    be used, a model without periodic motion, and a chain of another question.
    """
    use_persistent_cache()
    settings = SamplingSettings(
        sampler=sampler,
        target_ess=target_ess,
        time_limit_s=time_limit,
        patience_s=patience,
        fixed_tolerances=fixed_tolerances,
        orders=orders,
        seed=seed,
    )
    model = identified.model if isinstance(identified, Fit) else identified
    response = _measured(identified, measured, settings.orders, max_frequency, progress)
    question = question_about(model, response)
    kept = None if chain is None else Path(chain)
    found = sample_posterior(question, settings, kept, resume, progress, describe_posterior)
    if measured is None and isinstance(identified, Fit):
        return replace(found, origin=identified.origin)
    known = None if measured is None else campaign_of(measured)
    return replace(found, origin=model.origin(known, response.warnings))


def question_about(model: Model, measured: HarmonicResponse) -> Question:
    """What is asked of the data about an identified model."""
    free, values = model.identified
    return Question(measured, model.before, values, free)


def _measured(
    identified: Fit | Model,
    measured: Measurements | None,
    orders: int,
    max_frequency: float | None,
    progress: Progress,
) -> HarmonicResponse:
    if measured is not None:
        model = identified.model if isinstance(identified, Fit) else identified
        return measured_response(measured, model.plant, orders, max_frequency, progress)
    if isinstance(identified, Fit):
        return identified.measured
    raise InputError("a model alone has no posterior", remedy="give the campaign, or the fit")
