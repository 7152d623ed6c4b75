"""The public call ``sample``: the posterior of what was identified, and in words what its draws identify.

The sentences say which parameters trade off, what the data add to what was known, and which further dwell would
identify what the draws do not.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Origin, Progress, no_progress
from savgs_ident.fit.along_motion import MotionFit
from savgs_ident.fit.identifiability import (
    LARGEST_SD,
    advice_of,
    confounded_groups,
    known_combination,
    verdict_of,
)
from savgs_ident.fit.minimise import Minimiser
from savgs_ident.fit.result import Fit
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.inference.harmonic_question import PosedHarmonics, Question
from savgs_ident.inference.initial_states import compared_motion
from savgs_ident.inference.motion_question import MotionQuestion, PosedMotion
from savgs_ident.inference.posterior_mode import PosteriorMode
from savgs_ident.inference.problem import Task
from savgs_ident.inference.result import HarmonicPosterior, Marginal, MotionPosterior, Posterior, Sampler
from savgs_ident.inference.sample import sample_posterior
from savgs_ident.inference.samplers.chains import SamplingSettings
from savgs_ident.plants.model import Model
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.compared_tests import Measurements, campaign_of
from savgs_ident.simulate.driven_plant import held_against, origin_along, sized_along
from savgs_ident.simulate.program_cache import use_persistent_cache


def sample(
    identified: Fit | MotionFit | Model,
    measured: Measurements | DrivenMotion | None = None,
    sampler: Sampler = "emcee",
    *,
    target_ess: float = 1000.0,
    time_limit: float = 600.0,
    patience: float = 30.0,
    fixed_tolerances: bool = False,
    max_frequency: float | None = None,
    orders: int = 9,
    seed: int = 1,
    chain: str | Path | None = None,
    resume: bool = False,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Posterior:
    """Sample the posterior of the parameters that a fit identified: intervals, trade-offs, predictions.

    Tolerances are marginalised over, the noise's scale and the model's discrepancy estimated along.

    Args:
        identified: a fit, or a model that was identified.
        measured: the recordings, or the response of their dwells; what was fitted, if left out. A road is cut into
            windows, and without dwells so is a sweep; or, as in a fit, a plant is held against the force of its
            drive along the measured motion, or along one that is given.
        sampler: "emcee", an ensemble of walkers, or "nuts", gradient-based trajectories.
        target_ess: effective sample size to reach for every parameter [1].
        time_limit: stop sampling after this [s].
        patience: go on beyond the target up to this [s], for medians to a fortieth of their standard deviation.
        fixed_tolerances: hold what is known to a tolerance at its value.
        max_frequency: leave out faster dwells [Hz]; of windows, compare up to this; by default 15 Hz, and 40 Hz at
            most, for a plant as fast as a quarter car.
        orders: highest harmonic order to compare.
        seed: of all random numbers.
        chain: file in which the chain is kept after every step.
        resume: go on with the chain that is there.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` for a model without campaign, a campaign that cannot
    be used, a model without a solution, and a chain of another question.
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
    model = identified if not isinstance(identified, (Fit, MotionFit)) else identified.model
    checkpoint = None if chain is None else Path(chain)
    motion = _motion(identified, measured)
    if motion is not None:
        if max_frequency is not None:
            raise InputError(
                "a force along a measured motion has no frequencies",
                source="--max-frequency",
                remedy="leave it out",
            )
        origin, question = origin_along(model, motion, command), question_along(model, motion)
        return sample_posterior(
            question, settings, checkpoint, resume, progress, _describe_along_motion, origin
        )
    assert not isinstance(measured, DrivenMotion)
    fitted = identified if isinstance(identified, Fit) else model
    response = _measured(fitted, measured, settings.orders, max_frequency, progress)
    origin = _origin(fitted, measured, response).with_command(command)
    # As in a fit.
    with threadpool_limits(1, "blas"):
        return sample_posterior(
            question_about(model, response),
            settings,
            checkpoint,
            resume,
            progress,
            describe_posterior,
            origin,
        )


def _motion(
    identified: Fit | MotionFit | Model, measured: Measurements | DrivenMotion | None
) -> DrivenMotion | None:
    """The motion along which the model is held against the force of its drive; None where it is not."""
    if measured is None:
        return identified.motion if isinstance(identified, MotionFit) else None
    model = identified.model if isinstance(identified, (Fit, MotionFit)) else identified
    found = held_against(measured, model)
    return found if isinstance(found, DrivenMotion) else None


def _origin(identified: Fit | Model, measured: Measurements | None, response: HarmonicResponse) -> Origin:
    """That of the fit where its own data are sampled; else that of the model and the data."""
    if measured is None and isinstance(identified, Fit):
        return identified.origin
    model = identified.model if isinstance(identified, Fit) else identified
    return model.origin(None if measured is None else campaign_of(measured), response.warnings)


def question_about(model: Model, measured: HarmonicResponse) -> Question:
    """What is asked of the data about an identified model."""
    free, values = model.identified
    return Question(measured, model.before, values, free)


def question_along(model: Model, motion: DrivenMotion) -> MotionQuestion:
    """What is asked of a measured motion about an identified model."""
    free, values = model.identified
    return MotionQuestion(motion, sized_along(model.before, motion), values, free)


def _measured(
    identified: Fit | Model,
    measured: Measurements | None,
    orders: int,
    max_frequency: float | None,
    progress: Progress,
) -> HarmonicResponse:
    if measured is not None:
        model = identified.model if isinstance(identified, Fit) else identified
        response, _ = compared_motion(
            measured, model.before, orders, max_frequency, progress, identified=model
        )
        return response
    if isinstance(identified, Fit):
        return identified.measured
    raise InputError("a model alone has no posterior", remedy="give the campaign, or the fit")


TIED = 0.8
"""Correlation of logarithms from which two parameters are said to trade off."""

SHRUNK = 0.5
"""Contraction below which the data are said to add little to what was known."""

CLOSE = 0.15
"""Relative difference of standard deviations within which the Laplace approximation is said to agree."""


def describe_posterior(
    posed: PosedHarmonics,
    mode: PosteriorMode,
    marginals: Sequence[Marginal],
    draws: Mapping[str, NDArray[np.float64]],
) -> tuple[str, ...]:
    """All statements about a posterior, the most important first. ``draws`` (s,) are in SI, by name."""
    return sentences_of(marginals, draws, advise(posed.task, mode, draws))


def _describe_along_motion(
    posed: PosedMotion,
    mode: PosteriorMode,
    marginals: Sequence[Marginal],
    draws: Mapping[str, NDArray[np.float64]],
) -> tuple[str, ...]:
    """The same along a measured motion; which other motion would help is not known."""
    del posed, mode
    scale = next(each for each in marginals if each.name == "discrepancy")
    if scale.q025 > BACKGROUND.largest_error:
        return (
            *_discrepancy(marginals, MotionPosterior.errs_in, ""),
            "What is missing errs alike in many rows, so that the intervals are too narrow by far: the errors of "
            "`fit` allow for all of it along each parameter.",
        )
    return sentences_of(marginals, draws, (), MotionPosterior.errs_in, "")


ALLOWED = "; the intervals allow for that, for tolerances of damper curves and for drifts during the campaign"
"""What the intervals of a response allow for."""


def sentences_of(
    marginals: Sequence[Marginal],
    draws: Mapping[str, NDArray[np.float64]],
    advice: tuple[str, ...],
    errs_in: str = HarmonicPosterior.errs_in,
    allowed: str = ALLOWED,
) -> tuple[str, ...]:
    """The statements of a report, the most important first. ``draws`` (s,) are in SI, by name.

    ``errs_in`` says of what the discrepancy is a share, ``allowed`` what the intervals allow for.
    """
    identified = [each for each in marginals if each.role == "identified"]
    names = tuple(each.name for each in identified)
    covariance = log_covariance(names, draws)
    values = {each.name: each.median for each in identified}
    units = {each.name: each.unit for each in identified}
    verdict = verdict_of(names, values, units, covariance, {}, advice, {})
    return (
        *verdict.sentences,
        *_tied(names, covariance, confounded_groups(names, covariance)),
        *_discrepancy(marginals, errs_in, allowed),
        *_added(identified),
        *_laplace(identified),
    )


def log_covariance(names: Sequence[str], draws: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Covariance of the logarithms of the named parameters' draws, (n, n)."""
    logs = np.stack([np.log(np.maximum(np.abs(draws[name]), np.finfo(float).tiny)).ravel() for name in names])
    return np.atleast_2d(np.cov(logs))


def _tied(
    names: tuple[str, ...], covariance: NDArray[np.float64], confounded: Sequence[tuple[str, ...]]
) -> list[str]:
    """Pairs that are identifiable, but trade off: what is known of them together."""
    deviation = np.sqrt(np.diag(covariance))
    found = []
    for i, one in enumerate(names):
        for j, other in enumerate(names[:i]):
            tied = abs(covariance[i, j]) > TIED * deviation[i] * deviation[j]
            known = max(deviation[i], deviation[j]) <= LARGEST_SD
            if tied and known and not any({one, other} <= set(group) for group in confounded):
                label, error = known_combination((other, one), names, covariance)
                found.append(
                    f"{other} and {one} trade off along a line: {label} is known to {100.0 * error:.2g} %, "
                    f"they themselves to {100.0 * deviation[j]:.2g} % and {100.0 * deviation[i]:.2g} %."
                )
    return found


def _discrepancy(marginals: Sequence[Marginal], errs_in: str, allowed: str) -> list[str]:
    scale = next(each for each in marginals if each.name == "discrepancy")
    noise = next(each for each in marginals if each.name == "noise_scale")
    if not scale.q025 > BACKGROUND.largest_error:
        miss = f"The model errs by less than {100.0 * scale.q975:.2g} % {errs_in} (95 %){allowed}."
    else:
        miss = (
            f"To explain the data the model would have to err by {100.0 * scale.median:.2g} % {errs_in}: something "
            "is missing in it."
        )
    return [miss, f"The noise is {noise.median:.3g} times what the recordings show."]


def _added(identified: Sequence[Marginal]) -> list[str]:
    little = [each.name for each in identified if each.contraction < SHRUNK]
    return [f"The data add little to what was known of {', '.join(little)}."] if little else []


def _laplace(identified: Sequence[Marginal]) -> list[str]:
    off = [
        f"{each.name} ({100.0 * (each.laplace_sd / each.sd - 1.0):+.0f} %)"
        for each in identified
        if not abs(each.laplace_sd / each.sd - 1.0) < CLOSE
    ]
    if off:
        return [
            f"The posterior is not normal: its curvature at the mode misjudges the spread of {', '.join(off)}."
        ]
    return [f"The curvature at the mode gives the same standard deviations to {100.0 * CLOSE:.0f} %."]


def advise(task: Task, mode: PosteriorMode, draws: Mapping[str, NDArray[np.float64]]) -> tuple[str, ...]:
    """Sentences on dwells that would help; none if all parameters are identifiable.

    ``draws`` (s,) are in SI, by name.
    """
    covariance = log_covariance(task.problem.free.identified, draws)
    if np.sqrt(np.diag(covariance)).max() <= LARGEST_SD:
        return ()
    minimiser = Minimiser(task.problem)
    known = minimiser.evaluate(
        jnp.asarray(mode.linearisation_point.point[:-2]), mode.linearisation_point.warm_start
    )
    return advice_of(task, minimiser, known)
