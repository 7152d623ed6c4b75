"""Blind trials on campaigns like a recorded one, of any plant.

    study = blind_like(load_plant("bench.py:Bench"), load_campaign("roads.csv.gz"), "out/blind", trials=20)
    print(study)                            # the rates with their intervals, and where it was wrong

How often would the diagnosis be right on this plant, with these tests and this noise? The model is recalibrated on
the campaign, and campaigns like it are drawn (:mod:`savgs_ident.validation.recalibrated`) in which nothing is
missing, or one or two effects of the plant's catalogue, so large that the response changes by 3 to 25 %. Each is
diagnosed as any other. Truth and diagnosis have the equations of the plant in common: that a rig follows other laws,
or that another integrator moves it otherwise, is not tried here. The model is to explain the campaign, with the
effects that are known.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import prepare_folder
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.diagnosis.diagnose import diagnose_recalibrated
from savgs_ident.diagnosis.model_selection import recalibrate
from savgs_ident.diagnosis.public import Asked, ask
from savgs_ident.effects.effect import Effect
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.plants.model import Model
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.validation.blind import FILE, BlindStudy
from savgs_ident.validation.blind_answer import Answer
from savgs_ident.validation.blind_draw import LARGEST, SMALLEST, Shares
from savgs_ident.validation.blind_marks import failed, score_of
from savgs_ident.validation.blind_score import Score, score_from
from savgs_ident.validation.effect_size import draw_form, find_size
from savgs_ident.validation.recalibrated import RecalibratedCampaign, campaigns_like, origin_of
from savgs_ident.validation.trials import TrialFile, code_version, marks_of, once_a_process, run_trials

LIKE_SHARES = (25.0, 60.0, 15.0, 0.0)
"""How often nothing is missing, one effect, or two; none is removed from the catalogue."""

ATTEMPTS = 30
"""So many effects are drawn until one gives the change that was drawn: some cannot within their bounds."""


def blind_like(
    model: Model,
    campaign: Campaign | DrivenMotion,
    folder: str | Path,
    trials: int = 60,
    *,
    seed: int = 1,
    shares: tuple[float, float, float, float] | None = None,
    orders: int = 9,
    max_frequency: float | None = None,
    channels: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> BlindStudy:
    """Try the diagnosis on campaigns like a recorded one with known truth, of any plant; count how often it is right.

    Args:
        model: the baseline: it is to explain the campaign, with the effects that are known.
        campaign: the recordings, or a measured motion; what the drawn ones are like, in tests, noise and parameters.
        folder: where marks are kept; a run that was stopped goes on from there.
        trials: how many campaigns are drawn.
        seed: of all that is drawn.
        shares: how often nothing is missing, one effect, two; 25, 60, 15 and 0 if left out.
        orders: highest harmonic order to compare.
        max_frequency: leave out faster dwells [Hz].
        channels: the map that the campaign was read with, by which an earlier run is recognised.
        jobs: trials at a time on this machine; one for each core if left out.
        scheduler: address of a Dask cluster to work on instead.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Raises :class:`InputError` as :func:`diagnose` does, and for trials of something else in the folder.
    """
    use_persistent_cache()
    given = _shares_of(shares or LIKE_SHARES)
    marks: dict[str, Any] = marks_of(model, campaign, channels)
    marks |= {"orders": orders, "max_frequency": max_frequency, "seed": seed}
    marks |= {"shares": [given.none, given.effect, given.two, given.unknown]}
    file = TrialFile(prepare_folder(Path(folder)) / FILE, marks, resume=True)
    done = file.earlier(partial(score_from, catalogue=tuple(model.candidates)))
    asked = ask(model, campaign, orders, max_frequency, progress=progress)
    tried = _Tried(asked, given, seed)
    tried.bench(progress)
    found = run_trials(
        partial(_trial, tried), trials, file, done, jobs=jobs, scheduler=scheduler, progress=progress
    )
    origin = origin_of(model, asked, campaign).with_command(command)
    return BlindStudy(tuple(found), marks, origin=origin)


def _shares_of(shares: tuple[float, float, float, float]) -> Shares:
    found = Shares(*shares)
    if found.unknown > 0.0:
        raise InputError(
            "trials like a campaign have nothing, one effect or two of the catalogue",
            source="--shares",
            remedy="give 0 for unknown, such as: --shares 25 60 15 0",
        )
    return found


@dataclass(frozen=True)
class _Present:
    """An effect of a size: its parameters [SI], and by how much it changes the response, relative."""

    effect: Effect
    parameters: Mapping[str, float]
    change: float
    moved: NDArray[np.float64]


@dataclass(frozen=True)
class LikeBench:
    """A recorded campaign, recalibrated, and what trials like it are to have.

    Attributes:
        campaign: the campaign.
        asked: what is asked about it.
        shares: how often nothing is missing, one effect, or two.
        seed: of all that is drawn.
    """

    campaign: RecalibratedCampaign
    asked: Asked
    shares: Shares
    seed: int

    @property
    def catalogue(self) -> Mapping[str, Effect]:
        """The effects that may be missing."""
        known = self.asked.settings.baseline
        return {n: each for n, each in self.campaign.problem.plant.catalogue.items() if n not in known}

    def trial(self, number: int) -> Score:
        """The trial with this number, diagnosed; the same every time."""
        random = np.random.default_rng((self.seed, number))
        with threadpool_limits(1, "blas"):
            answer, rows = self._drawn(number, random)
            problem = self.campaign.recorded(rows, random)
            if problem is None:
                found: Mapping[str, Any] = failed("the recalibrated model has no motion")
            else:
                of = self.asked
                found = json.loads(diagnose_recalibrated(problem, of.given, of.settings, of.values).to_json())
        return score_of(answer, found, code_version(), catalogue=self.campaign.problem.plant.catalogue)

    def _drawn(self, number: int, random: np.random.Generator) -> tuple[Answer, NDArray[np.float64]]:
        """The truth of a trial, and what it shows, (m,).

        Raises :class:`InputError` if no effect that was drawn gives the change drawn.
        """
        kind = self.shares.draw(random)
        for _ in range(ATTEMPTS):
            truth = self.campaign.truth(random)
            bare = self.campaign.rows((), truth)
            if bare is None:
                continue
            names = random.choice(list(self.catalogue), {"none": 0, "effect": 1}.get(kind, 2), replace=False)
            present = [self._present(self.catalogue[str(name)], truth, bare, random) for name in names]
            there = [each for each in present if each is not None]
            rows = self._together(truth, bare, there)
            if len(there) == len(present) and rows is not None:
                return self._answer(number, kind, truth, there), rows
        raise InputError(
            f"nothing of kind '{kind}' reaches the change that was drawn",
            source=f"trial {number}",
            remedy="name another --seed, or give effects with wider bounds",
        )

    def _present(
        self,
        effect: Effect,
        truth: Mapping[str, float],
        bare: NDArray[np.float64],
        random: np.random.Generator,
    ) -> _Present | None:
        """An effect of a size drawn; None where no size within its bounds does that much."""
        form = draw_form(effect, random)
        target = float(np.exp(random.uniform(np.log(SMALLEST), np.log(LARGEST))))
        found: dict[float, NDArray[np.float64]] = {}

        def change(size: float) -> float | None:
            rows = self.campaign.rows((effect.name,), {**truth, **form.at(size)})
            if rows is None:
                return None
            found[size] = rows - bare
            return self._change(found[size], bare)

        size = find_size(change, target, form.most)
        if size is None:
            return None
        return _Present(effect, form.at(size), self._change(found[size], bare), found[size])

    def _change(self, moved: NDArray[np.float64], bare: NDArray[np.float64]) -> float:
        """By how much the response changes, relative: the largest over the channels of all tests."""
        level = np.unique(self.campaign.levels.level, return_inverse=True)[1]
        size = np.sqrt(np.bincount(level, bare**2))
        return float(np.max(np.sqrt(np.bincount(level, moved**2)) / np.maximum(size, np.finfo(float).tiny)))

    def _together(
        self, truth: Mapping[str, float], bare: NDArray[np.float64], present: Sequence[_Present]
    ) -> NDArray[np.float64] | None:
        if len(present) < 2:
            return bare + sum((each.moved for each in present), np.zeros(bare.size))
        given = dict(truth)
        for each in present:
            given |= each.parameters
        return self.campaign.rows(tuple(each.effect.name for each in present), given)

    def _answer(
        self, number: int, kind: Any, truth: Mapping[str, float], present: Sequence[_Present]
    ) -> Answer:
        return Answer(
            number=number,
            kind=kind,
            effects=tuple(each.effect.name for each in present),
            ports=tuple(each.effect.port.location for each in present),
            changes={each.effect.name: each.change for each in present},
            sigmas={each.effect.name: self._sigma(each, present) for each in present},
            imitators=(),
            parameters={name: value for each in present for name, value in each.parameters.items()},
            rig=truth,
            without=(),
        )

    def _sigma(self, present: _Present, all_of_them: Sequence[_Present]) -> float:
        """By how many standard deviations an effect stands out of noise, small errors and calibration.

        To first order: of a large effect that calibration takes up along a curve more seems to be left than is. What
        the other one does is projected out.
        """
        base, data = self.campaign.problem.base, self.campaign.problem.data
        scales = base.noise_scales
        sd = np.sqrt(data.independent.marginal(scales.noise, scales.discrepancy))

        def left(rows: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(data.turned(rows).T / sd).T

        slopes = (data.turned(base.slopes).T / sd).T
        covariance = base.covariance()

        def product(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
            return float(one @ other - (slopes.T @ one) @ covariance @ (slopes.T @ other))

        mine = left(present.moved)
        seen = product(mine, mine)
        for each in all_of_them:
            if each is not present:
                beside = left(each.moved)
                seen -= product(mine, beside) ** 2 / max(product(beside, beside), np.finfo(float).tiny)
        return float(np.sqrt(max(seen, 0.0)))


@dataclass(frozen=True)
class _Tried:
    """What trials follow from; ``key`` is the same in all processes."""

    asked: Asked
    shares: Shares
    seed: int
    key: str = field(default_factory=lambda: uuid4().hex)

    def bench(self, progress: Progress = no_progress) -> LikeBench:
        """What they are drawn from."""
        return once_a_process(self.key, lambda: like_bench(self.asked, self.shares, self.seed, progress))


def like_bench(asked: Asked, shares: Shares, seed: int, progress: Progress) -> LikeBench:
    """The baseline recalibrated on what was ``asked`` about.

    Raises :class:`InputError` as :func:`savgs_ident.diagnosis.public.diagnose` does, and for a baseline that does not
    explain it: what is missing in it would be missing in every trial.
    """
    with threadpool_limits(1, "blas"):
        plant, data = asked.problem()
        problem = recalibrate(plant, data, asked.values, progress, asked.settings.constants)
    misses = problem.base.noise_scales.discrepancy
    if misses > BACKGROUND.largest_error:
        raise InputError(
            f"the model does not explain the campaign: for that it would have to err by {100.0 * misses:.2g} %",
            remedy="find what is missing with `diagnose`, and give the model.toml that `fit --with EFFECT` writes",
        )
    return LikeBench(campaigns_like(asked, problem), asked, shares, seed)


def _trial(tried: _Tried, number: int) -> Score:
    return tried.bench().trial(number)
