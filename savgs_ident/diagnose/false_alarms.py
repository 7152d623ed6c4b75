"""How often a diagnosis would cry wolf: campaigns like a recorded one in which nothing is missing.

The recalibrated baseline is the truth of every one of them: parameters drawn from what the recorded campaign leaves
open about them, the noise of the record, which a diagnosis knows no better than that of a record, nothing else. Each
is diagnosed as any other. The share of those in which
something is said to be missing is the false-alarm rate of this campaign, and their odds are what its own odds are to
be compared with.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta
from threadpoolctl import threadpool_limits

from savgs_ident.core.rig import Rig
from savgs_ident.diagnose.engine.climb import climb, refine, search_of
from savgs_ident.diagnose.engine.coordinates import reach_of, values_at
from savgs_ident.diagnose.engine.search import Tell
from savgs_ident.diagnose.judgement import Case, judge, recalibrate
from savgs_ident.diagnose.settings import DiagnosisSettings
from savgs_ident.diagnose.verdict import odds_of
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.responses.harmonic_response import HarmonicResponse

CONFIDENCE = 0.95
"""Of the bound that is given of a rate."""


@dataclass(frozen=True)
class NullDraw:
    """A campaign in which nothing is missing, and what was made of it.

    Attributes:
        number: its number.
        odds: log odds that something is missing, against nothing; missing where the campaign could not be solved.
        alarm: whether something was said to be missing.
        named: what was said to be.
    """

    number: int
    odds: float | None
    alarm: bool
    named: Sequence[str]


@dataclass(frozen=True)
class AlarmBench:
    """A recorded campaign, recalibrated: what campaigns with nothing missing are drawn from.

    Attributes:
        case: the campaign as a case.
        odds: its own log odds that something is missing.
        dof: degrees of freedom of the noise level behind each row, (m,); infinite where it is known.
        level: which level that is, (m,).
        seed: of all random numbers.
    """

    case: Case
    odds: float
    dof: NDArray[np.float64]
    level: NDArray[np.intp]
    seed: int

    def draw(self, number: int) -> NullDraw:
        """The draw with this number; the same every time."""
        with threadpool_limits(1, "blas"):
            case = self._null_case(np.random.default_rng((self.seed, number)))
            if case is None:
                return NullDraw(number, None, False, ())
            judged = judge(case, _silent)
        alarm = judged.kind != "none"
        return NullDraw(
            number, odds_of(judged.weighed), alarm, judged.chosen.effects or (judged.kind,) * alarm
        )

    def _null_case(self, random: np.random.Generator) -> Case | None:
        base, plant = self.case.base, self.case.plant
        spread = np.linalg.cholesky(base.covariance()) @ random.standard_normal(base.x.size)
        truth = values_at(base.coordinates, np.clip(base.x + spread, *reach_of(base.coordinates)))
        asked = [each.name for each in base.coordinates]
        found = plant.predict((), truth, asked, base.prediction.near)
        if not found.solved:
            return None
        # On nodes of its own: what finitely many of them cost is then not the same in truth and model.
        there = plant.predict((), truth, asked, plant.refined((), truth, found.near))
        noise = base.misfit.noise * np.sqrt(self.case.data.variance)
        rows = there.rows + noise * random.standard_normal(there.rows.size)
        return self._recalibrated(rows, self._estimated_variance(random)) if there.solved else None

    def _estimated_variance(self, random: np.random.Generator) -> NDArray[np.float64]:
        """The variances (m,) as a record of the same length would show them."""
        _, first, level = np.unique(self.level, return_index=True, return_inverse=True)
        dof = self.dof[first]
        known = np.isinf(dof)
        shown = np.where(known, 1.0, random.chisquare(np.where(known, 1.0, dof)) / np.where(known, 1.0, dof))
        return np.asarray(self.case.data.variance * shown[level])

    def _recalibrated(self, rows: NDArray[np.float64], variance: NDArray[np.float64]) -> Case | None:
        known = self.case
        likelihood = eqx.tree_at(lambda each: each.measured, known.plant.likelihood, jnp.asarray(rows))
        plant, data = (
            replace(known.plant, likelihood=likelihood),
            replace(known.data, measured=rows, variance=variance),
        )
        search = search_of(plant, data)
        base = climb(search, (), known.base.values, known.base.prediction.near)
        if not np.isfinite(base.evidence):
            return None
        return Case(plant, data, search, base.prediction.rows, refine(search, base, ()))


def alarm_bench(
    measured: HarmonicResponse,
    rig: Rig,
    settings: DiagnosisSettings,
    values: Mapping[str, float],
    seed: int,
    tell: Tell,
) -> AlarmBench:
    """Recalibrate the baseline on a measured response, and judge it.

    Raises :class:`InputError` as :func:`savgs_ident.diagnose.diagnose.diagnose_response` does. ``values``
    are parameters in SI.
    """
    with threadpool_limits(1, "blas"):
        case = recalibrate(measured, rig, settings, values, tell)
        odds = odds_of(judge(case, tell).weighed)
    level = case.data.test * len(RESPONSE_CHANNELS) + case.plant.channel
    return AlarmBench(case, odds, _degrees_of_freedom(measured, case), level, seed)


def _degrees_of_freedom(measured: HarmonicResponse, case: Case) -> NDArray[np.float64]:
    """Of the noise level behind each row, (m,)."""
    if measured.covariance_dof is None:
        return np.full(case.data.measured.size, np.inf)
    channels = [name for name in RESPONSE_CHANNELS if name in measured.channels]
    first = {RESPONSE_CHANNELS.index(name): measured.channel(name) for name in channels}
    places = np.array([first[channel] for channel in case.plant.channel])
    return np.asarray(measured.covariance_dof[case.data.test, places, 1])


def rate_bound(alarms: int, drawn: int) -> float:
    """Highest rate [1] that so many alarms leave possible (Clopper and Pearson, 1934); 1 where none was drawn."""
    return 1.0 if alarms >= drawn else float(beta.ppf(CONFIDENCE, alarms + 1, drawn - alarms))


def _silent(line: str) -> None:
    del line
