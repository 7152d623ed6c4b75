"""Sampling: from a measured response and an identified model to the posterior.

posterior = sample_posterior(Question(measured, rig, values, effects, free), SamplingSettings("nuts"))
posterior.by_name["mu_r"].q025, posterior.convergence.converged
"""

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from savgs_ident import __version__
from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import Rig
from savgs_ident.fit.settings import FitSettings
from savgs_ident.fit.target import harmonic_target
from savgs_ident.fit.task import Task, plan_task
from savgs_ident.posterior.advice import advise
from savgs_ident.posterior.chains import Chains
from savgs_ident.posterior.diagnostics import (
    enough,
    judge_chains,
    least_ess,
    mixing_of,
    others_mixed,
    precise,
)
from savgs_ident.posterior.expand import Expansion, expand
from savgs_ident.posterior.keep import Keep, digest_of, new_keep, open_keep
from savgs_ident.posterior.likelihood import likelihood_of
from savgs_ident.posterior.marginals import marginals_of, names_by_role
from savgs_ident.posterior.mode import Case, Mode, Progress, find_mode
from savgs_ident.posterior.predict import predict
from savgs_ident.posterior.prior import prior_of
from savgs_ident.posterior.result import Posterior
from savgs_ident.posterior.samplers import SAMPLERS
from savgs_ident.posterior.settings import SamplingSettings
from savgs_ident.posterior.values import values_of
from savgs_ident.posterior.words import sentences_of
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import simulate_periodic


@dataclass(frozen=True)
class Question:
    """What is asked of the data.

    Attributes:
        measured: the response.
        rig: the rig as known before the data: the centres and tolerances of its priors.
        values: where to look for the mode: identified values by name, SI; the rig's own where left out.
        effects: names of the effects in the model.
        free: names of the parameters that the data alone identify.
    """

    measured: HarmonicResponse
    rig: Rig
    values: Mapping[str, float]
    effects: tuple[str, ...]
    free: tuple[str, ...]


class _Answer(NamedTuple):
    """Everything that a result is made of."""

    task: Task
    case: Case
    mode: Mode
    expansion: Expansion
    chains: Chains


def sample_posterior(
    question: Question,
    settings: SamplingSettings,
    chain: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Posterior:
    """Sample until every identified parameter has the effective sample size asked for, or time is up.

    The chain is kept at the path ``chain``, after every step; with ``resume`` it is continued. Look at
    ``convergence.converged`` of the result. Raises :class:`InputError` for a question that makes no sense, a
    model without periodic motion where the search begins, and a chain of another question.
    """
    began, tell = time.perf_counter(), progress or _silent
    task = plan(question, settings)
    case = case_of(task)
    keep = _keep(question, settings, chain, resume)
    mode = locate(case, task, question, tell)
    expansion = expand(case, mode.foothold, tell)
    chains = _run(expansion, settings, keep, began, tell)
    wall_s = time.perf_counter() - began
    tell("summing up")
    return _summed_up(_Answer(task, case, mode, expansion, chains), question, settings, wall_s)


def plan(question: Question, settings: SamplingSettings) -> Task:
    """The fitting task behind a question: its model, free vector and target."""
    options = FitSettings(
        orders=settings.orders, fixed_tolerances=settings.fixed_tolerances, periodic=settings.periodic
    )
    return plan_task(question.measured, question.rig, question.effects, question.free, options)


def case_of(task: Task) -> Case:
    """The posterior's ingredients: always the complex harmonics, never peak-to-peak values."""
    target = harmonic_target(task.measured, task.settings.orders)
    return Case(task.problem, likelihood_of(target), prior_of(task.problem.free))


def locate(case: Case, task: Task, question: Question, tell: Progress) -> Mode:
    """The mode, looked for from the question's values.

    Raises :class:`InputError` if the model has no periodic motion there.
    """
    tell("solving the model")
    start = task.table.as_dict() | dict(question.values)
    u = case.problem.free.to_unconstrained(start)
    near = simulate_periodic(
        case.problem.model, case.problem.parameters(u), task.excitation, task.settings.periodic
    )
    mode = find_mode(case, u, near, tell)
    if not np.isfinite(mode.foothold.value):
        raise InputError(
            "the model has no periodic motion at these parameters",
            remedy="identify it first: savgs-ident fit",
        )
    return mode


def _silent(line: str) -> None:
    del line


def _keep(question: Question, settings: SamplingSettings, chain: Path | None, resume: bool) -> Keep:
    measured = question.measured
    case = digest_of(
        {
            "harmonics": measured.harmonics,
            "covariance": measured.covariance,
            "frequency": measured.frequency,
            "rig": [(each.name, each.value, each.tolerance) for each in question.rig.parameters.entries],
            "damper": (question.rig.damper_velocity, question.rig.damper_force),
            "values": sorted(question.values.items()),
            "model": (question.effects, question.free),
            "settings": replace(
                settings, target_ess=0.0, time_limit_s=0.0, patience_s=0.0, predictive_draws=0
            ),
            "version": __version__,
        }
    )
    return open_keep(chain, case) if resume and chain is not None else new_keep(chain, case)


def _run(
    expansion: Expansion, settings: SamplingSettings, keep: Keep, began: float, tell: Progress
) -> Chains:
    """Chains until they are long enough or time is up.

    Raises :class:`InputError` if by then the model was solved at no proposal.
    """
    count = len(expansion.exact.problem.free.identified)
    with closing(SAMPLERS[settings.sampler](*expansion, settings.seed, keep)) as sampler:
        while True:
            chains = next(sampler)
            mixing = [mixing_of(chains.points[:, :, place]) for place in range(count)]
            ess, spent = least_ess(mixing), time.perf_counter() - began
            tell(
                f"{settings.sampler}: {len(chains.points)} steps of {chains.points.shape[1]} chains, effective "
                f"sample size {ess:.0f} of {settings.target_ess:.0f}, {spent:.0f} s"
            )
            done = enough(mixing, settings.target_ess) and (precise(mixing) or spent > settings.patience_s)
            late = spent > settings.time_limit_s
            # The first steps are left out: until there is a draw there is nothing to sum up.
            if (done and others_mixed(chains, count)) or (late and len(chains.points)):
                return chains
            if late and chains.unsolved == chains.evaluations:
                raise InputError(
                    "the model has a periodic motion at none of the points that the surrogate proposes",
                    remedy="identify it first: savgs-ident fit",
                )


def _summed_up(answer: _Answer, question: Question, settings: SamplingSettings, wall_s: float) -> Posterior:
    case, chains = answer.case, answer.chains
    roles = names_by_role(case.problem.free)
    values = values_of(case.problem.free, case.likelihood.scales, chains.points)
    mixing = {name: mixing_of(values[name]) for name in roles}
    identified = [mixing[name] for name, role in roles.items() if role == "identified"]
    others = [mixing[name] for name, role in roles.items() if role != "identified"]
    status = answer.mode.status
    doubts = () if status.ok else (f"the mode was not found: {status.advice}",)
    convergence = judge_chains(chains, identified, others, settings.target_ess, doubts)
    marginals = marginals_of(case, answer.expansion.surrogate, chains, mixing)
    draws = {name: values[name].T for name in roles}
    medians = {each.name: each.median for each in marginals if each.role != "nuisance"}
    return Posterior(
        rig=replace(question.rig, parameters=answer.task.table.with_values(medians)),
        effects=question.effects,
        sampler=settings.sampler,
        marginals=marginals,
        draws=draws,
        statistics={"lp": chains.log_density.T, "accepted": chains.accepted.T.astype(float)},
        convergence=convergence,
        predictive=predict(answer.expansion.exact, chains, settings.predictive_draws, settings.seed),
        measured=question.measured,
        sentences=sentences_of(marginals, draws, advise(answer.task, answer.mode, draws)),
        wall_s=wall_s,
    )
