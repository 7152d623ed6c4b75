"""Simulation-based calibration: whether intervals hold what they say.

Parameters are drawn from their priors, a campaign is simulated with them (the frequencies, the noise and the
road of a recorded one), and its posterior is sampled as any other. If density and sampler are right, the rank
of every true value among its posterior's draws is uniform, and 95 % intervals hold it 95 times in a hundred
(Talts, Betancourt, Simpson, Vehtari and Gelman, 2018).

The priors are narrower than those of an identification, which reach to where the rig does not move at all:
identified parameters are normal about the given values, with :data:`SPREAD`, and the discrepancy is about as
large as the noise. What the solver's own nodes leave open counts as discrepancy too.
"""

from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.effects.registry import model_parameters
from savgs_ident.fit.target import harmonic_target
from savgs_ident.fit.task import Task
from savgs_ident.posterior.diagnostics import least_ess, mixing_of
from savgs_ident.posterior.expand import Expansion, expand
from savgs_ident.posterior.keep import new_keep
from savgs_ident.posterior.likelihood import likelihood_of
from savgs_ident.posterior.marginals import names_by_role
from savgs_ident.posterior.mode import Case, find_mode
from savgs_ident.posterior.prior import prior_of
from savgs_ident.posterior.sample import Question, plan
from savgs_ident.posterior.samplers import SAMPLERS
from savgs_ident.posterior.scales import Scales
from savgs_ident.posterior.settings import SamplingSettings
from savgs_ident.posterior.values import values_of
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSolution, simulate_periodic

SPREAD = 0.15
"""Relative standard deviation of the identified parameters."""

SCALES = Scales(discrepancy=0.002)

INTERVAL = 0.95

RANKED = 39
"""Draws among which a true value is ranked: it takes one of forty places."""


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
    case: Case
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
        return self._ranked(case, expand(case, mode.foothold, _silent), number, truth)

    def _draw(self, random: np.random.Generator) -> Float[np.ndarray, " n+2"]:
        return random.standard_normal(len(self.case.problem.free.names) + 2)

    def _simulate(
        self, truth: Float[np.ndarray, " n+2"], random: np.random.Generator
    ) -> Float[np.ndarray, " m"] | None:
        problem, likelihood = self.case.problem, self.case.likelihood
        p = problem.parameters(jnp.asarray(truth[:-2]))
        layout = self.middle.mesh.layout
        solution = simulate_periodic(problem.model, p, self.task.excitation, self.settings.periodic, layout)
        if not all(status.ok for status in solution.status()):
            return None
        rows = np.asarray(likelihood.rows(harmonics(problem.model, p, solution, problem.orders)))
        spread = np.asarray(likelihood.spread(jnp.asarray(truth)))
        return rows + np.sqrt(spread) * random.standard_normal(rows.size)

    def _ranked(
        self, case: Case, expansion: Expansion, number: int, truth: Float[np.ndarray, " n+2"]
    ) -> Trial:
        free, scales = case.problem.free, case.likelihood.scales
        sampler = SAMPLERS[self.settings.sampler](*expansion, 1 + number, new_keep(None, ""))
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
    known = replace(question.rig, parameters=_known(question))
    narrow = replace(question, rig=known, values={}, free=())
    task = plan(narrow, settings)
    problem = task.problem
    likelihood = likelihood_of(harmonic_target(question.measured, settings.orders), SCALES)
    case = Case(problem, likelihood, prior_of(problem.free))
    values = problem.parameters(jnp.zeros(len(problem.free.names)))
    middle = simulate_periodic(problem.model, values, task.excitation, settings.periodic)
    return Calibrator(task, case, settings, middle, question.free)


def uniformity(ranks: list[int], bins: int = 8) -> float:
    """Probability of a rank histogram at least as uneven as this one, if ranks were uniform (chi2 test)."""
    counts = np.bincount(np.array(ranks, dtype=int) * bins // (RANKED + 1), minlength=bins)
    expected = len(ranks) / bins
    return float(chi2.sf(np.sum((counts - expected) ** 2) / expected, bins - 1))


def _known(question: Question) -> ParameterTable:
    """The rig's parameters, those that are identified known about the question's values."""

    def about(entry: Parameter) -> Parameter:
        if entry.name not in question.free:
            return entry
        value = question.values.get(entry.name, entry.value)
        return replace(entry, value=value, tolerance=SPREAD * abs(value))

    table = model_parameters(question.rig, question.effects)
    return ParameterTable(tuple(about(entry) for entry in table.entries))


def _silent(line: str) -> None:
    del line
