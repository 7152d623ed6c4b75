"""Sampling: from a measured response and an identified model to the posterior.

    posterior = sample_posterior(Question(measured, model, values, free), SamplingSettings("nuts"))
    posterior.by_name["mu_r"].q025, posterior.convergence.converged

The mode is found, with the background of small errors that every model has; the surrogate is expanded about it, a
sampler draws until the draws suffice or time is up, and the draws are summed up: marginals, convergence, and what
they predict for a repetition of the campaign.
"""

import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Complex, Float
from numpy.typing import NDArray

from savgs_ident import __version__
from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import NO_ORIGIN, Origin, Progress
from savgs_ident.inference.diagnostics import (
    assess_convergence,
    enough,
    least_ess,
    marginals_of,
    mixing_of,
    mixing_of_identified,
    mixing_of_others,
    names_by_role,
    others_mixed,
    precise,
)
from savgs_ident.inference.likelihood import likelihood_of, values_of
from savgs_ident.inference.near_mode import ExactModel, Surrogate
from savgs_ident.inference.posterior_mode import (
    Expansion,
    PosteriorDensity,
    PosteriorMode,
    expand,
    find_mode,
    find_mode_again,
    with_background,
)
from savgs_ident.inference.prior import Prior
from savgs_ident.inference.problem import ProblemSettings, Task, harmonic_target, plan_task
from savgs_ident.inference.result import Marginal, Posterior, Predictive, Sampler
from savgs_ident.inference.samplers.chains import (
    Chains,
    Checkpoint,
    SamplingSettings,
    digest_of,
    new_checkpoint,
    open_checkpoint,
)
from savgs_ident.inference.samplers.emcee import sample_by_emcee
from savgs_ident.inference.samplers.nuts import sample_by_nuts
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import simulate_periodic

SAMPLERS: Mapping[Sampler, Callable[[ExactModel, Surrogate, int, Checkpoint], Generator[Chains]]] = {
    "emcee": sample_by_emcee,
    "nuts": sample_by_nuts,
}
"""Each gives chains that grow, for as long as it is asked."""


WITHIN = 0.95
"""Share of repetitions that the band holds."""


def predict(exact: ExactModel, chains: Chains, count: int, seed: int) -> Predictive:
    """The prediction at ``count`` draws, evenly spaced along the chains; unsolved ones are left out."""
    flat = chains.points.reshape(-1, chains.points.shape[-1])
    points = flat[np.unique(np.linspace(0, len(flat) - 1, count).astype(int))]
    found = exact.responses(points[:, :-2])
    points, model = points[found.solved], found.harmonics[found.solved]
    likelihood, shape = exact.likelihood, model.shape[1:]
    spread = np.asarray(jax.vmap(likelihood.spread)(jnp.asarray(points)))
    errors = np.random.default_rng(seed).standard_normal(spread.shape) * np.sqrt(spread)
    replicated = model + likelihood.harmonics(errors, shape)
    measured = likelihood.harmonics(np.asarray(likelihood.measured)[None], shape)[0]
    used = np.asarray(exact.problem.target.used)
    return Predictive(model, np.where(used, replicated, 0.0), used, _inside(measured, replicated, used))


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


Describe = Callable[
    [Task, PosteriorMode, Sequence[Marginal], Mapping[str, NDArray[np.float64]]], tuple[str, ...]
]
"""What the draws (s,) [SI] identify, in words: of the task, its mode, the marginals and the draws by name."""


class _Answer(NamedTuple):
    """Everything that a result is made of."""

    task: Task
    posterior: PosteriorDensity
    mode: PosteriorMode
    expansion: Expansion
    chains: Chains


def sample_posterior(
    question: Question,
    settings: SamplingSettings,
    chain: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    describe: Describe | None = None,
    origin: Origin = NO_ORIGIN,
) -> Posterior:
    """Sample until every identified parameter has the effective sample size asked for, or time is up.

    The chain is kept at the path ``chain``, after every step; with ``resume`` it is continued. ``describe`` gives the
    sentences of the result, none by default; ``origin`` is that of the result. Look at
    ``convergence.converged`` of the result. Raises :class:`InputError` for a question that makes no sense, a
    model without periodic motion where the search begins, and a chain of another question.
    """
    began, report = time.perf_counter(), progress or _silent
    task = plan(question, settings)
    posterior = density_of(task)
    checkpoint = _checkpoint(question, settings, chain, resume)
    mode = locate(posterior, task, question, report)
    report("looking for the mode with a background of small errors")
    at, drifting = mode.linearisation_point, task.problem.free.identified
    posterior, _ = with_background(posterior, at, question.measured.times, drifting)
    mode = find_mode_again(posterior, mode, report)
    expansion = expand(posterior, mode.linearisation_point, report)
    chains = _run(expansion, settings, checkpoint, began, report)
    wall_s = time.perf_counter() - began
    report("summing up")
    answer = _Answer(task, posterior, mode, expansion, chains)
    return _summed_up(answer, question, settings, wall_s, describe or _nothing, origin)


def plan(question: Question, settings: SamplingSettings) -> Task:
    """The fitting task behind a question: its model, free vector and target."""
    options = ProblemSettings(
        orders=settings.orders, fixed_tolerances=settings.fixed_tolerances, periodic=settings.periodic
    )
    return plan_task(question.measured, question.model, question.free, options)


def density_of(task: Task) -> PosteriorDensity:
    """The density of the posterior: always the complex harmonics, never peak-to-peak values."""
    target = harmonic_target(task.measured, task.model.channels, task.settings.orders)
    return PosteriorDensity(task.problem, likelihood_of(target), Prior(task.problem.free))


def locate(posterior: PosteriorDensity, task: Task, question: Question, report: Progress) -> PosteriorMode:
    """The mode, looked for from the question's values.

    Raises :class:`InputError` if the model has no periodic motion there.
    """
    report("solving the model")
    start = task.table.as_dict() | dict(question.values)
    u = posterior.problem.free.to_unconstrained(start)
    warm_start = simulate_periodic(
        posterior.problem.model, posterior.problem.parameters(u), task.excitation, task.settings.periodic
    )
    mode = find_mode(posterior, u, warm_start, report)
    if not mode.solved:
        raise InputError(
            "the model has no periodic motion at these parameters",
            remedy="identify it first: savgs-ident fit",
        )
    return mode


def _nothing(*_: object) -> tuple[str, ...]:
    return ()


def _silent(line: str) -> None:
    del line


def _checkpoint(
    question: Question, settings: SamplingSettings, chain: Path | None, resume: bool
) -> Checkpoint:
    measured = question.measured
    case = digest_of(
        {
            "harmonics": measured.harmonics,
            "covariance": measured.covariance,
            "frequency": measured.frequency,
            "parameters": [(each.name, each.value, each.tolerance) for each in question.model.table.entries],
            "plant": [np.asarray(leaf) for leaf in jax.tree.leaves(question.model.build())],
            "values": sorted(question.values.items()),
            "model": (question.model.name, question.model.effects, question.free),
            "settings": replace(
                settings, target_ess=0.0, time_limit_s=0.0, patience_s=0.0, predictive_draws=0
            ),
            "version": __version__,
        }
    )
    return open_checkpoint(chain, case) if resume and chain is not None else new_checkpoint(chain, case)


def _run(
    expansion: Expansion, settings: SamplingSettings, checkpoint: Checkpoint, began: float, report: Progress
) -> Chains:
    """Chains until they are long enough or time is up.

    Raises :class:`InputError` if by then the model was solved at no proposal.
    """
    count = len(expansion.exact.problem.free.identified)
    with closing(SAMPLERS[settings.sampler](*expansion, settings.seed, checkpoint)) as sampler:
        while True:
            chains = next(sampler)
            mixing = mixing_of_identified(chains, count)
            ess, spent = least_ess(mixing), time.perf_counter() - began
            report(
                f"{settings.sampler}: {len(chains.points)} steps of {chains.points.shape[1]} chains, effective "
                f"sample size {ess:.0f} of {settings.target_ess:.0f}, {spent:.0f} s"
            )
            done = enough(mixing, settings.target_ess) and (precise(mixing) or spent > settings.patience_s)
            late = spent > settings.time_limit_s
            # The first steps are left out: until there is a draw there is nothing to sum up.
            if (done and others_mixed(mixing_of_others(chains, count))) or (late and len(chains.points)):
                return chains
            if late and chains.unsolved == chains.evaluations:
                raise InputError(
                    "the model has a periodic motion at none of the points that the surrogate proposes",
                    remedy="identify it first: savgs-ident fit",
                )


def _summed_up(
    answer: _Answer,
    question: Question,
    settings: SamplingSettings,
    wall_s: float,
    describe: Describe,
    origin: Origin,
) -> Posterior:
    posterior, chains = answer.posterior, answer.chains
    roles = names_by_role(posterior.problem.free)
    values = values_of(posterior.problem.free, posterior.likelihood.scales, chains.points)
    mixing = {name: mixing_of(values[name]) for name in roles}
    # Of coordinates, as the chains were stopped: a map of them moves R-hat by what may be over the limit.
    count = len(posterior.problem.free.identified)
    identified, others = mixing_of_identified(chains, count), mixing_of_others(chains, count)
    status = answer.mode.status
    doubts = () if status.ok else (f"the mode was not found: {status.advice}",)
    convergence = assess_convergence(chains, identified, others, settings.target_ess, doubts)
    marginals = marginals_of(posterior, answer.expansion.surrogate, chains, mixing)
    draws = {name: values[name].T for name in roles}
    medians = {each.name: each.median for each in marginals if each.role != "nuisance"}
    return Posterior(
        model=question.model.with_parameters(answer.task.table.with_values(medians)),
        sampler=settings.sampler,
        marginals=marginals,
        draws=draws,
        statistics={"lp": chains.log_density.T, "accepted": chains.accepted.T.astype(float)},
        convergence=convergence,
        predictive=predict(answer.expansion.exact, chains, settings.predictive_draws, settings.seed),
        measured=question.measured,
        sentences=describe(answer.task, answer.mode, marginals, draws),
        wall_s=wall_s,
        origin=origin,
    )
