"""How often a diagnosis would cry wolf: campaigns like a recorded one in which nothing is missing.

The recalibrated baseline is the truth of every one of them: parameters drawn from what the recorded campaign leaves
open about them, the noise of the record, which a diagnosis knows no better than that of a record, nothing else. Each
is diagnosed as any other. The share of those in which something is said to be missing is the false-alarm rate of this
campaign, and their odds are what its own odds are to be compared with.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import ClassVar
from uuid import uuid4

import numpy as np
from scipy.stats import beta
from threadpoolctl import threadpool_limits

from savgs_ident.core.files import prepare_folder, record_of
from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.diagnosis.conclusion import conclude, leave_tests_out
from savgs_ident.diagnosis.diagnose import fit_hypotheses
from savgs_ident.diagnosis.model_selection import decide_among, recalibrate
from savgs_ident.diagnosis.public import Asked, ask
from savgs_ident.diagnosis.verdict import alarm_odds
from savgs_ident.plants.model import Model
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.validation.recalibrated import RecalibratedCampaign, campaigns_like, origin_of
from savgs_ident.validation.trials import TrialFile, marks_of, once_a_process, run_trials

CONFIDENCE = 0.95
"""Of the bound that is given of a rate."""

FILE = "draws.jsonl"
"""The file in which draws are kept."""


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


LEAST_ODDS = -1000.0
"""Log odds of a campaign in which no hypothesis came near enough to be fitted."""


@dataclass(frozen=True)
class AlarmBench:
    """A recorded campaign, recalibrated: what campaigns with nothing missing are drawn from.

    Attributes:
        campaign: the campaign.
        odds: its own log odds that something is missing.
        seed: of all random numbers.
    """

    campaign: RecalibratedCampaign
    odds: float
    seed: int

    def draw(self, number: int) -> NullDraw:
        """The draw with this number; the same every time."""
        random = np.random.default_rng((self.seed, number))
        with threadpool_limits(1, "blas"):
            rows = self.campaign.rows((), self.campaign.truth(random))
            problem = None if rows is None else self.campaign.recorded(rows, random)
            if problem is None:
                return NullDraw(number, None, False, ())
            problem, fitted = fit_hypotheses(problem, no_progress)
            selected = decide_among(problem, fitted)
            said = conclude(leave_tests_out(problem, selected, {}, no_progress, None), {}, None).evidence
        named = said.chosen.hypothesis.effects or (said.kind,) * (said.kind != "none")
        return NullDraw(number, max(alarm_odds(selected.weighed), LEAST_ODDS), said.kind != "none", named)


def alarm_bench(asked: Asked, seed: int, progress: Progress) -> AlarmBench:
    """Recalibrate the baseline on what was ``asked`` about, and weigh hypotheses against it.

    Raises :class:`InputError` as :func:`savgs_ident.diagnosis.public.diagnose` does.
    """
    with threadpool_limits(1, "blas"):
        plant, data = asked.problem()
        problem = recalibrate(plant, data, asked.values, progress, asked.settings.constants)
        problem, fitted = fit_hypotheses(problem, progress)
        odds = max(alarm_odds(decide_among(problem, fitted).weighed), LEAST_ODDS)
    return AlarmBench(campaigns_like(asked, problem), odds, seed)


MOST = 0.02
"""Rate of false alarms that is allowed."""


@dataclass(frozen=True)
class AlarmStudy(Result):
    """Campaigns with nothing missing, diagnosed, and the log ``odds`` of the campaign that they are like."""

    presenter: ClassVar[str] = "ALARM_STUDY"

    draws: tuple[NullDraw, ...]
    odds: float

    @property
    def trusted(self) -> bool:
        """Whether there are as few alarms as there may be."""
        return bool(self.solved) and self.alarms <= MOST * len(self.solved)

    @property
    def solved(self) -> tuple[float, ...]:
        """Log odds of the draws that could be solved."""
        return tuple(each.odds for each in self.draws if each.odds is not None)

    @property
    def alarms(self) -> int:
        """How many of the draws were false alarms."""
        return sum(each.alarm for each in self.draws)

    @property
    def rate_at_most(self) -> float:
        """The rate of false alarms that they leave possible [1]."""
        return rate_bound(self.alarms, len(self.solved))


def false_alarms(
    model: Model,
    campaign: Campaign | DrivenMotion,
    draws: int = 100,
    *,
    orders: int = 9,
    max_frequency: float | None = None,
    seed: int = 1,
    folder: str | Path | None = None,
    resume: bool = False,
    channels: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> AlarmStudy:
    """Count false alarms: how often does a diagnosis find something in campaigns like this one with nothing missing?

    The baseline is recalibrated on the campaign; campaigns are drawn from it (its frequencies, its noise, parameters
    within what it leaves open) and diagnosed. The odds that the campaign itself gives are put beside theirs.

    Args:
        model: the baseline.
        campaign: the recordings, or a measured motion; what the drawn ones are like.
        draws: how many are drawn.
        orders: highest harmonic order to compare.
        max_frequency: leave out faster dwells [Hz].
        seed: of all random numbers.
        folder: where each draw is kept as soon as it is there; nowhere if left out.
        resume: keep the draws that an earlier run left there.
        channels: the map that the campaign was read with, by which an earlier run is recognised.
        jobs: draws at a time on this machine; one for each core if left out.
        scheduler: address of a Dask cluster to work on instead.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Raises :class:`InputError` as :func:`diagnose` does, and for draws of something else in the folder.
    """
    use_persistent_cache()
    file = None
    if folder is not None:
        marks = marks_of(model, campaign, channels)
        marks |= {"max_frequency": max_frequency, "orders": orders, "seed": seed}
        file = TrialFile(prepare_folder(Path(folder)) / FILE, marks, resume)
    done = [] if file is None else file.earlier(read_draw)
    asked = ask(model, campaign, orders, max_frequency, progress=progress)
    drawn = _Drawn(asked, seed)
    bench = drawn.bench(progress)
    found = run_trials(
        partial(_draw, drawn), draws, file, done, jobs=jobs, scheduler=scheduler, progress=progress
    )
    origin = origin_of(model, asked, campaign).with_command(command)
    return AlarmStudy(tuple(found), bench.odds, origin=origin)


@dataclass(frozen=True)
class _Drawn:
    """What draws follow from; ``key`` is the same in all processes."""

    asked: Asked
    seed: int
    key: str = field(default_factory=lambda: uuid4().hex)

    def bench(self, progress: Progress = no_progress) -> AlarmBench:
        """What they are drawn from."""
        return once_a_process(self.key, lambda: alarm_bench(self.asked, self.seed, progress))


def _draw(drawn: _Drawn, number: int) -> NullDraw:
    return drawn.bench().draw(number)


def read_draw(fields: Mapping[str, object]) -> NullDraw:
    """The draw of a line of the file; raises ``ValueError`` for what is none."""
    return record_of(NullDraw, fields)


def rate_bound(alarms: int, drawn: int) -> float:
    """Highest rate [1] that so many alarms leave possible (Clopper and Pearson, 1934); 1 where none was drawn."""
    return 1.0 if alarms >= drawn else float(beta.ppf(CONFIDENCE, alarms + 1, drawn - alarms))
