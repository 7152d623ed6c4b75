"""Simulation-based calibration: whether intervals hold what they say.

Parameters are drawn from their priors, a campaign is simulated with them (the frequencies, the noise and the
road of a recorded one), and its posterior is sampled as any other. If density and sampler are right, the rank
of every true value among its posterior's draws is uniform, and 95 % intervals hold it 95 times in a hundred
(Talts, Betancourt, Simpson, Vehtari and Gelman, 2018).

The priors are narrower than those of an identification, which reach to where the rig does not move at all:
identified parameters are normal about the given values, with :data:`SPREAD`. Errors are drawn as the likelihood has
them: noise, tolerances of curves, drifts, and a background of small errors about the middle of the priors.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, cast
from uuid import uuid4

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from savgs_ident.core.files import prepare_folder, record_of
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.fit.sampling import question_about
from savgs_ident.inference.diagnostics import least_ess, mixing_of, names_by_role
from savgs_ident.inference.expansion import Expansion
from savgs_ident.inference.harmonic_model import SampledHarmonics
from savgs_ident.inference.harmonic_question import Question, plan
from savgs_ident.inference.likelihood import Likelihood, likelihood_of, values_of
from savgs_ident.inference.posterior_mode import (
    PosteriorDensity,
    find_mode,
    linearisation_point,
    with_background,
)
from savgs_ident.inference.prior import Prior
from savgs_ident.inference.problem import Task
from savgs_ident.inference.result import Sampler
from savgs_ident.inference.sample import SAMPLERS, expand_about_draws
from savgs_ident.inference.samplers.chains import SamplingSettings, new_checkpoint
from savgs_ident.inference.targets import harmonic_target
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.recordings.recording import Campaign
from savgs_ident.simulate.compared_tests import every_so_many, measured_response
from savgs_ident.simulate.periodic import PeriodicSolution, simulate_periodic
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.simulate.readings import harmonics
from savgs_ident.validation.trials import TrialFile, marks_of, once_a_process, run_trials

SPREAD = 0.15
"""Relative standard deviation of the identified parameters."""

INTERVAL = 0.95

RANKED = 39
"""Draws among which a true value is ranked: it takes one of forty places."""

DRAWS = 100.0
"""Effective sample size of a trial's posterior: enough for its ranks and the ends of its intervals."""

FILE = "trials.jsonl"
"""The file in which trials are kept."""


@dataclass(frozen=True)
class Trial:
    """One synthetic campaign.

    ``rank`` is the place of each true value among :data:`RANKED` draws, 0..RANKED; ``inside`` whether its
    95 % interval holds it; both empty if the campaign could not be simulated (``solved`` is false), or its
    mode was not found (``found`` is false). ``ess`` is the least effective sample size.
    """

    number: int
    solved: bool
    found: bool
    ess: float
    rank: dict[str, int]
    inside: dict[str, bool]


class Calibrator(eqx.Module):
    """A case whose data are drawn anew for every trial, and the model at the middle of its priors.

    ``asked`` are the parameters whose effective sample size counts.
    """

    task: Task
    case: PosteriorDensity
    settings: SamplingSettings
    middle: PeriodicSolution
    asked: tuple[str, ...] = eqx.field(static=True)

    def trial(self, number: int) -> Trial:
        """The trial with this number; the same every time."""
        random = np.random.default_rng((self.settings.seed, number))
        truth = self._draw(random)
        rows = self._simulate(truth, random)
        if rows is None:
            return Trial(number, False, False, 0.0, {}, {})
        case = self.case._replace(
            likelihood=eqx.tree_at(lambda each: each.measured, self.case.likelihood, jnp.asarray(rows))
        )
        mode = find_mode(case, jnp.zeros(truth.size - 2), self.middle, _silent)
        if not mode.status.ok:
            return Trial(number, True, False, 0.0, {}, {})
        expansion = expand_about_draws(case, mode.linearisation_point, 1 + number, _silent)
        return self._ranked(case, expansion, number, truth)

    def _draw(self, random: np.random.Generator) -> Float[np.ndarray, " n+2"]:
        return random.standard_normal(len(self.case.problem.free.names) + 2)

    def _simulate(
        self, truth: Float[np.ndarray, " n+2"], random: np.random.Generator
    ) -> Float[np.ndarray, " m"] | None:
        problem, likelihood = self.task.problem, cast(Likelihood, self.case.likelihood)
        p = problem.parameters(jnp.asarray(truth[:-2]))
        layout = self.middle.mesh.layout
        solution = simulate_periodic(problem.model, p, self.task.excitation, self.settings.periodic, layout)
        if not all(status.ok for status in solution.status()):
            return None
        rows = np.asarray(likelihood.rows(harmonics(problem.model, p, solution, problem.orders)))
        spread = np.asarray(likelihood.spread(jnp.asarray(truth)))
        return rows + np.sqrt(spread) * random.standard_normal(rows.size)

    def _ranked(
        self, case: PosteriorDensity, expansion: Expansion, number: int, truth: Float[np.ndarray, " n+2"]
    ) -> Trial:
        free, scales = case.problem.free, case.likelihood.scales
        sampler = SAMPLERS[self.settings.sampler](*expansion, 1 + number, new_checkpoint(None, ""))
        asked = [free.names.index(name) for name in self.asked]
        while True:
            chains = next(sampler)
            ess = least_ess([mixing_of(chains.points[:, :, place]) for place in asked])
            if ess >= self.settings.target_ess or chains.evaluations > 8 * self.settings.target_ess:
                break
        sampler.close()
        flat = chains.points.reshape(-1, truth.size)
        values, true = values_of(free, scales, flat), values_of(free, scales, truth[None])
        spaced = np.linspace(0, len(flat) - 1, RANKED).astype(int)
        ends = [0.5 * (1.0 - INTERVAL), 0.5 * (1.0 + INTERVAL)]
        inside, rank = {}, {}
        for name in names_by_role(free):
            # The k-th of n draws has k / (n + 1) of the posterior below it on average.
            low, high = np.quantile(values[name], ends, method="weibull")
            inside[name] = bool(low <= true[name][0] <= high)
            rank[name] = int(np.sum(values[name][spaced] < true[name][0]))
        return Trial(number, True, True, ess, rank, inside)


def calibrator(question: Question, settings: SamplingSettings) -> Calibrator:
    """The calibrator for campaigns like the one in ``question``, about its values."""
    known = question.model.with_parameters(_known(question))
    narrow = replace(question, model=known, values={}, free=())
    task = plan(narrow, settings)
    problem = task.problem
    likelihood = likelihood_of(harmonic_target(question.measured, known.channels, settings.orders))
    plain = PosteriorDensity(
        SampledHarmonics(problem, question.measured.times), likelihood, Prior(problem.free)
    )
    u = jnp.zeros(len(problem.free.names))
    middle = simulate_periodic(problem.model, problem.parameters(u), task.excitation, settings.periodic)
    at = linearisation_point(plain, u, middle)
    case, _ = with_background(plain, at, question.free)
    return Calibrator(task, case, settings, middle, question.free)


BINS = 8
"""Bars of a rank histogram."""

LEAST, MOST = 0.90, 0.99
"""Coverage of 95 % intervals, all parameters together, that counts as right."""

UNEVEN = 1e-3
"""Probability of an uneven rank histogram, times the number of parameters, below which ranks are wrong."""


@dataclass(frozen=True)
class Coverage:
    """How often intervals held the truth, and how even its ranks are.

    Attributes:
        inside: share of the intervals of each parameter that held its true value [1].
        uniformity: probability of a rank histogram of each at least as uneven [1].
        overall: share of all intervals that held the truth [1].
    """

    inside: Mapping[str, float]
    uniformity: Mapping[str, float]
    overall: float

    @property
    def even(self) -> bool:
        """Whether no rank histogram is more uneven than chance allows."""
        return all(each > UNEVEN / len(self.uniformity) for each in self.uniformity.values())

    @property
    def calibrated(self) -> bool:
        """Whether coverage and ranks are what they should be."""
        return bool(self.inside) and LEAST <= self.overall <= MOST and self.even


@dataclass(frozen=True)
class CalibrationStudy(Result):
    """The trials, and the parameters that were ranked, identified ones first."""

    presenter: ClassVar[str] = "CALIBRATION_STUDY"

    trials: tuple[Trial, ...]
    names: tuple[str, ...]

    @property
    def trusted(self) -> bool:
        """Whether coverage and ranks are what they should be."""
        return self.coverage.calibrated

    @property
    def coverage(self) -> Coverage:
        """Coverage and ranks; a trial whose mode was not found counts as one whose intervals miss."""
        solved = sum(trial.solved for trial in self.trials)
        ranked = [trial for trial in self.trials if trial.solved and trial.found]
        held = {name: sum(trial.inside[name] for trial in ranked) for name in self.names}
        return Coverage(
            inside={name: count / max(solved, 1) for name, count in held.items()},
            uniformity={name: uniformity([trial.rank[name] for trial in ranked]) for name in self.names},
            overall=sum(held.values()) / max(solved * len(self.names), 1),
        )


def calibrate(
    model: RigModel,
    campaign: Campaign,
    trials: int = 100,
    sampler: Sampler = "emcee",
    *,
    every: int = 1,
    seed: int = 1,
    folder: str | Path | None = None,
    resume: bool = False,
    channels: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> CalibrationStudy:
    """Check the posterior on synthetic campaigns: do 95 % intervals hold the truth 95 times in a hundred?

    Parameters are drawn from their priors about the model, campaigns like this one are simulated with them and
    sampled (simulation-based calibration).

    Args:
        model: an identified model.
        campaign: what the simulated ones are like.
        trials: how many are simulated.
        sampler: "emcee" or "nuts".
        every: take every so many dwells only: quicker, coarser.
        seed: of all random numbers.
        folder: where each trial is kept as soon as it is there; nowhere if left out.
        resume: keep the trials that an earlier run left there.
        channels: the map that the campaign was read with, by which an earlier run is recognised.
        jobs: trials at a time on this machine; one for each core if left out.
        scheduler: address of a Dask cluster to work on instead.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Raises :class:`InputError` as :func:`sample` does, and for trials of something else in the folder.
    """
    use_persistent_cache()
    file = None
    if folder is not None:
        marks = marks_of(model, campaign.source, channels)
        marks |= {"sampler": sampler, "every": every, "seed": seed}
        file = TrialFile(prepare_folder(Path(folder)) / FILE, marks, resume)
    done = [] if file is None else file.earlier(trial_reader())
    response = measured_response(campaign, model.plant, SamplingSettings.orders, None, progress)
    question = question_about(model, every_so_many(response, every))
    asked = _Asked(question, SamplingSettings(sampler, target_ess=DRAWS, seed=seed))
    progress("preparing")
    asked.calibrator()
    found = run_trials(
        partial(_trial, asked), trials, file, done, jobs=jobs, scheduler=scheduler, progress=progress
    )
    ranked = next((each.rank for each in found if each.rank), {})
    names = sorted(ranked, key=lambda name: name not in question.free)
    origin = model.origin(campaign, response.warnings).with_command(command)
    return CalibrationStudy(tuple(found), tuple(names), origin=origin)


@dataclass(frozen=True)
class _Asked:
    """What trials follow from; ``key`` is the same in all processes."""

    question: Question
    settings: SamplingSettings
    key: str = field(default_factory=lambda: uuid4().hex)

    def calibrator(self) -> Calibrator:
        """What makes them."""
        return once_a_process(self.key, lambda: calibrator(self.question, self.settings))


def _trial(asked: _Asked, number: int) -> Trial:
    return asked.calibrator().trial(number)


def trial_reader() -> Callable[[Mapping[str, object]], Trial]:
    """Makes a trial of each line of a file; raises ``ValueError`` for what is none, or not like those before."""
    ranked: set[str] = set()

    def trial(fields: Mapping[str, object]) -> Trial:
        found = record_of(Trial, fields)
        ranked.update(found.rank)
        if found.rank.keys() != found.inside.keys() or (found.rank and found.rank.keys() != ranked):
            raise ValueError("trials are of different parameters")
        if not all(0 <= rank <= RANKED for rank in found.rank.values()):
            raise ValueError("a rank is none")
        return found

    return trial


def uniformity(ranks: list[int], bins: int = BINS) -> float:
    """Probability of a rank histogram at least as uneven as this one, if ranks were uniform (chi2 test)."""
    counts = np.bincount(np.array(ranks, dtype=int) * bins // (RANKED + 1), minlength=bins)
    expected = len(ranks) / bins
    return float(chi2.sf(np.sum((counts - expected) ** 2) / expected, bins - 1))


def _known(question: Question) -> ParameterTable:
    """The model's parameters, those that are identified known about the question's values."""

    def about(entry: Parameter) -> Parameter:
        if entry.name not in question.free:
            return entry
        value = question.values.get(entry.name, entry.value)
        return replace(entry, value=value, tolerance=SPREAD * abs(value))

    return ParameterTable(tuple(about(entry) for entry in question.model.table.entries))


def _silent(line: str) -> None:
    del line
