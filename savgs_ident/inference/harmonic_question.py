"""What harmonics say of a model: the question that a posterior answers, and what it predicts of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Complex, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Progress
from savgs_ident.inference.harmonic_model import ExactHarmonics, SampledHarmonics
from savgs_ident.inference.likelihood import likelihood_of
from savgs_ident.inference.posterior_mode import PosteriorDensity, PosteriorMode, find_mode
from savgs_ident.inference.prior import Prior
from savgs_ident.inference.problem import ProblemSettings, Task, plan_task
from savgs_ident.inference.result import HarmonicPosterior, Predictive
from savgs_ident.inference.samplers.chains import Chains, SamplingSettings
from savgs_ident.inference.targets import harmonic_target
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import simulate_periodic

WITHIN = 0.95
"""Share of repetitions that the band holds."""


def predict(exact: ExactHarmonics, chains: Chains, count: int, seed: int) -> Predictive:
    """The prediction at ``count`` draws, evenly spaced along the chains; unsolved ones are left out."""
    flat = chains.points.reshape(-1, chains.points.shape[-1])
    points = flat[np.unique(np.linspace(0, len(flat) - 1, count).astype(int))]
    found = exact.responses(points[:, :-2])
    points, model = points[found.solved], found.harmonics[found.solved]
    likelihood, shape = exact.likelihood, model.shape[1:]
    spread = np.asarray(jax.vmap(likelihood.spread)(jnp.asarray(points)))
    errors = np.random.default_rng(seed).standard_normal(spread.shape) * np.sqrt(spread)
    rows = np.stack([likelihood.rows_of_one(each) for each in model])
    read, replicated = (likelihood.harmonics(each, shape) for each in (rows, rows + errors))
    measured = likelihood.harmonics(np.asarray(likelihood.measured)[None], shape)[0]
    used = np.asarray(exact.problem.target.used)
    inside = _inside(measured, replicated, used)
    return Predictive(np.where(used, read, model), np.where(used, replicated, 0.0), used, inside)


def _inside(
    measured: Complex[np.ndarray, "D C K"], replicated: Complex[np.ndarray, "S D C K"], used: np.ndarray
) -> Bool[np.ndarray, "D C K"]:
    """Whether a phasor is no further from the repetitions' mean than 95 % of them, in their covariance."""
    middle = replicated.mean(axis=0)
    off = _parts(replicated - middle)
    covariance = np.einsum("sdcki,sdckj->dckij", off, off) / len(off)
    precision = np.linalg.inv(np.where(used[..., None, None], covariance, np.eye(2)))

    def distance(parts: Float[np.ndarray, "... 2"]) -> Float[np.ndarray, "..."]:
        return np.asarray(np.einsum("...i,...ij,...j->...", parts, precision, parts))

    return np.asarray(
        used & (distance(_parts(measured - middle)) <= np.quantile(distance(off), WITHIN, axis=0))
    )


def _parts(values: np.ndarray) -> np.ndarray:
    return np.stack([values.real, values.imag], axis=-1)


@dataclass(frozen=True)
class Question:
    """What is asked of the data.

    Attributes:
        measured: the response.
        model: the model as known before the data: the centres and tolerances of its priors.
        values: where to look for the mode: identified values by name, SI; the model's own where left out.
        free: names of the parameters that the data alone identify.
    """

    measured: HarmonicResponse
    model: Model
    values: Mapping[str, float]
    free: tuple[str, ...]

    @property
    def marks(self) -> Mapping[str, object]:
        """What the data are, by which a chain is recognised."""
        measured = self.measured
        return {
            "harmonics": measured.harmonics,
            "covariance": measured.covariance,
            "frequency": measured.frequency,
        }

    def posed(self, settings: SamplingSettings) -> "PosedHarmonics":
        """The question with what is to be compared."""
        return PosedHarmonics(self, settings)


@dataclass(frozen=True)
class PosedHarmonics:
    """A question with what is to be compared."""

    question: Question
    settings: SamplingSettings

    @cached_property
    def task(self) -> Task:
        """The fitting task behind it."""
        return plan(self.question, self.settings)

    @cached_property
    def density(self) -> PosteriorDensity:
        """Of its posterior, without a background of small errors."""
        return density_of(self.task)

    def mode(self, report: Progress) -> PosteriorMode:
        """That of this density; raises :class:`InputError` if the model has no periodic motion at its values."""
        return locate(self.density, self.task, self.question, report)

    def answer(self, exact: ExactHarmonics, chains: Chains, answer: Mapping[str, Any]) -> HarmonicPosterior:
        """The posterior, of which the ``answer`` has what is not of the harmonics."""
        predicted = predict(exact, chains, self.settings.predictive_draws, self.settings.seed)
        return HarmonicPosterior(predictive=predicted, measured=self.question.measured, **answer)


def plan(question: Question, settings: SamplingSettings) -> Task:
    """The fitting task behind a question: its model, free vector and target."""
    options = ProblemSettings(
        orders=settings.orders, fixed_tolerances=settings.fixed_tolerances, periodic=settings.periodic
    )
    return plan_task(question.measured, question.model, question.free, options)


def density_of(task: Task) -> PosteriorDensity:
    """The density of the posterior: always the complex harmonics, never peak-to-peak values."""
    target = harmonic_target(task.measured, task.model.channels, task.settings.orders)
    problem = SampledHarmonics(task.problem, task.measured.times)
    return PosteriorDensity(problem, likelihood_of(target), Prior(task.problem.free))


def locate(posterior: PosteriorDensity, task: Task, question: Question, report: Progress) -> PosteriorMode:
    """The mode, looked for from the question's values.

    Raises :class:`InputError` if the model has no periodic motion there.
    """
    report("solving the model")
    start = task.table.as_dict() | dict(question.values)
    problem = task.problem
    u = problem.free.to_unconstrained(start)
    warm_start = simulate_periodic(
        problem.model, problem.parameters(u), task.excitation, task.settings.periodic
    )
    mode = find_mode(posterior, u, warm_start, report)
    if not mode.solved:
        raise InputError(
            "the model has no periodic motion at these parameters",
            remedy="identify it first: savgs-ident fit",
        )
    return mode
