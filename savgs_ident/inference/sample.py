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
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import jax
import numpy as np
from numpy.typing import NDArray

from savgs_ident import __version__
from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import NO_ORIGIN, Origin, Progress
from savgs_ident.core.threads import side_by_side
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
from savgs_ident.inference.expansion import Expansion, expand
from savgs_ident.inference.likelihood import values_of
from savgs_ident.inference.near_mode import ExactModel, LinearisationPoint, Surrogate
from savgs_ident.inference.posterior_mode import PosteriorDensity, PosteriorMode, find_mode_with_background
from savgs_ident.inference.result import Marginal, Posterior, Sampler
from savgs_ident.inference.samplers.chains import (
    Chains,
    Checkpoint,
    SamplingSettings,
    digest_of,
    new_checkpoint,
    open_checkpoint,
)
from savgs_ident.inference.samplers.emcee import about_draws, sample_by_emcee
from savgs_ident.inference.samplers.nuts import sample_by_nuts
from savgs_ident.inference.surrogate_shape import Shape, shape_of
from savgs_ident.plants.model import Model

SAMPLERS: Mapping[Sampler, Callable[[ExactModel, Surrogate, int, Checkpoint], Generator[Chains]]] = {
    "emcee": sample_by_emcee,
    "nuts": sample_by_nuts,
}
"""Each gives chains that grow, for as long as it is asked."""

_FORM = 2
"""Of what is kept of chains: it grows when their numbers mean something else, and older ones are refused."""


class PosedQuestion(Protocol):
    """A question with what is to be compared."""

    @property
    def density(self) -> PosteriorDensity:
        """Of its posterior, without a background of small errors."""

    def mode(self, report: Progress) -> PosteriorMode:
        """That of this density; raises :class:`InputError` if the model has no solution where the search begins."""

    def answer(self, exact: Any, chains: Chains, answer: Mapping[str, Any]) -> Posterior:
        """The posterior, of which the ``answer`` has what does not depend on what was measured."""


class AnyQuestion(Protocol):
    """What is asked of data, whatever they are."""

    @property
    def model(self) -> Model:
        """The model as known before the data: the centres and tolerances of its priors."""

    @property
    def values(self) -> Mapping[str, float]:
        """Where to look for the mode: identified values by name, SI; the model's own where left out."""

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that the data alone identify."""

    @property
    def marks(self) -> Mapping[str, object]:
        """What the data are, by which a chain is recognised."""

    def posed(self, settings: SamplingSettings) -> PosedQuestion:
        """The question with what is to be compared."""


UNSETTLED = (
    "what small errors of the model do depends on the parameters by more than these are known: the intervals are too "
    "narrow, and the errors of `fit` allow for it"
)
"""Why a posterior is not to be trusted whose background is not that of its own mode."""

Describe = Callable[
    [Any, PosteriorMode, Sequence[Marginal], Mapping[str, NDArray[np.float64]]], tuple[str, ...]
]
"""What the draws (s,) [SI] identify, in words: of the posed question, its mode, the marginals, the draws by name."""


class _Answer(NamedTuple):
    """Everything that a result is made of."""

    posed: PosedQuestion
    posterior: PosteriorDensity
    mode: PosteriorMode
    expansion: Expansion
    shape: Shape
    chains: Chains
    settled: bool


def sample_posterior(
    question: AnyQuestion,
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
    model without a solution where the search begins, and a chain of another question.
    """
    began, report = time.perf_counter(), progress or _silent
    posed = question.posed(settings)
    checkpoint = _checkpoint(question, settings, chain, resume)
    mode = posed.mode(report)
    report("looking for the mode with a background of small errors")
    drifting = posed.density.problem.free.identified
    located = find_mode_with_background(posed.density, mode.linearisation_point, drifting, report)
    posterior, mode = located.density, located.mode
    expansion = expand_about_draws(posterior, mode.linearisation_point, settings.seed, report)
    chains, shape = side_by_side(
        lambda: _run(expansion, settings, checkpoint, began, report),
        lambda: shape_of(posterior, expansion.surrogate),
    )
    wall_s = time.perf_counter() - began
    report("summing up")
    answer = _Answer(posed, posterior, mode, expansion, shape, chains, located.settled)
    return _summed_up(answer, question, settings, wall_s, describe or _nothing, origin)


def expand_about_draws(
    posterior: PosteriorDensity, at: LinearisationPoint, seed: int, report: Progress
) -> Expansion:
    """The model about a point of its posterior, as samplers take it: the surrogate about its own draws."""
    expansion = expand(posterior, at, report)
    return expansion._replace(surrogate=about_draws(expansion.surrogate, seed))


def _nothing(*_: object) -> tuple[str, ...]:
    return ()


def _silent(line: str) -> None:
    del line


def _checkpoint(
    question: AnyQuestion, settings: SamplingSettings, chain: Path | None, resume: bool
) -> Checkpoint:
    case = digest_of(
        {
            **question.marks,
            "parameters": [(each.name, each.value, each.tolerance) for each in question.model.table.entries],
            "plant": [np.asarray(leaf) for leaf in jax.tree.leaves(question.model.build())],
            "values": sorted(question.values.items()),
            "model": (question.model.name, question.model.effects, question.free),
            "settings": replace(
                settings, target_ess=0.0, time_limit_s=0.0, patience_s=0.0, predictive_draws=0
            ),
            "version": (__version__, _FORM),
        }
    )
    return open_checkpoint(chain, case) if resume and chain is not None else new_checkpoint(chain, case)


def _run(
    expansion: Expansion, settings: SamplingSettings, checkpoint: Checkpoint, began: float, report: Progress
) -> Chains:
    """Chains until they are long enough or time is up.

    Raises :class:`InputError` if by then the model was solved at no proposal.
    """
    count = len(expansion.surrogate.prior.free.identified)
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
                    "the model has a solution at none of the points that the surrogate proposes",
                    remedy="identify it first: savgs-ident fit",
                )


def _summed_up(
    answer: _Answer,
    question: AnyQuestion,
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
    doubts = [] if status.ok else [f"the mode was not found: {status.advice}"]
    doubts += [] if answer.settled else [UNSETTLED]
    convergence = assess_convergence(chains, identified, others, settings.target_ess, doubts)
    marginals = marginals_of(posterior, answer.shape, chains, mixing)
    draws = {name: values[name].T for name in roles}
    medians = {each.name: each.median for each in marginals if each.role != "nuisance"}
    table = question.model.table
    result = {
        "model": question.model.with_parameters(table.with_values(medians)),
        "sampler": settings.sampler,
        "marginals": marginals,
        "draws": draws,
        "statistics": {"lp": chains.log_density.T, "accepted": chains.accepted.T.astype(float)},
        "convergence": convergence,
        "sentences": describe(answer.posed, answer.mode, marginals, draws),
        "wall_s": wall_s,
        "origin": origin,
    }
    return answer.posed.answer(answer.expansion.exact, chains, result)
