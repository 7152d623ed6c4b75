"""A recorded campaign with its baseline recalibrated, and campaigns like it whose truth is known.

The truth of each has parameters drawn from what the recorded campaign leaves open about them. Its response is
computed on nodes of its own, so that what finitely many of them cost is not the same in truth and model; it gets the
noise and the small errors that the recorded one has, of which a diagnosis knows no more than there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import exp

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Origin
from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.evidence import DiagnosisProblem
from savgs_ident.diagnosis.public import Asked, AskedMotion, NoiseLevels
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.inference.find_map import find_map, refine
from savgs_ident.inference.laplace_fit import search_of
from savgs_ident.inference.prior import bounds_of, values_at
from savgs_ident.plants.model import Model
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.simulate.driven_plant import origin_along

MOST_TRUST = 3.0
"""A noise is larger than measured by so many standard deviations of its logarithm at most.

A baseline that lacks something takes what it misses for noise, as far as its prior lets it."""


HALF_ERR = 0.6745
"""Half of all models err by less than so many widths of the prior of small errors: the median of a half-normal."""


@dataclass(frozen=True)
class RecalibratedCampaign:
    """A recorded campaign, recalibrated: what campaigns like it are drawn from.

    Attributes:
        problem: the campaign, its baseline recalibrated.
        levels: of the noise of its rows.
    """

    problem: DiagnosisProblem
    levels: NoiseLevels

    def truth(self, random: np.random.Generator) -> dict[str, float]:
        """Parameters [SI] that the recorded campaign leaves possible."""
        base = self.problem.base
        spread = np.linalg.cholesky(base.covariance()) @ random.standard_normal(base.x.size)
        return values_at(base.coordinates, np.clip(base.x + spread, *bounds_of(base.coordinates)))

    def rows(self, effects: tuple[str, ...], truth: Mapping[str, float]) -> NDArray[np.float64] | None:
        """What such a plant with ``effects`` shows, (m,) [unit of the row]; None where it has no motion."""
        base, plant = self.problem.base, self.problem.plant
        asked = [each.name for each in base.coordinates]
        near = plant.predict(effects, truth, asked, base.prediction.warm_start)
        if not near.solved:
            return None
        found = plant.predict(effects, truth, asked, plant.refined(effects, truth, near.warm_start))
        return found.rows if found.solved else None

    def recorded(self, rows: NDArray[np.float64], random: np.random.Generator) -> DiagnosisProblem | None:
        """A campaign that shows ``rows``, with errors, its baseline recalibrated; None where that has no motion."""
        known, scales = self.problem, self.problem.base.noise_scales
        # Where rows share no errors, there is noise alone.
        errs = 0.0 if known.data.shared is None else scales.discrepancy
        if errs > BACKGROUND.largest_error:
            # Something is missing, and nothing is known of the small errors beside it.
            errs = HALF_ERR * BACKGROUND.material_error
        noise = min(scales.noise, exp(MOST_TRUST * known.data.scales.noise_trust))
        measured = rows + known.data.draw_errors(noise, errs, random)
        data = replace(known.data, measured=measured, variance=self._estimated_variance(random))
        plant = known.plant.seeing(measured) if isinstance(known.plant, DwellProblem) else known.plant
        search = search_of(plant, data)
        base = find_map(search, (), known.base.values, known.base.prediction.warm_start)
        if not base.solved:
            return None
        return replace(
            known,
            plant=plant,
            data=data,
            search=search,
            given=base.prediction.rows,
            base=refine(search, base, ()),
        )

    def _estimated_variance(self, random: np.random.Generator) -> NDArray[np.float64]:
        """The variances (m,) as a record of the same length would show them."""
        _, first, level = np.unique(self.levels.level, return_index=True, return_inverse=True)
        dof = self.levels.dof[first]
        known = np.isinf(dof)
        shown = np.where(known, 1.0, random.chisquare(np.where(known, 1.0, dof)) / np.where(known, 1.0, dof))
        return np.asarray(self.problem.data.variance * shown[level])


def origin_of(model: Model, asked: Asked, campaign: Campaign | DrivenMotion) -> Origin:
    """Where results on campaigns like one come from."""
    if isinstance(asked, AskedMotion):
        return origin_along(model, asked.motion)
    return model.origin(campaign if isinstance(campaign, Campaign) else None, asked.warnings)


def campaigns_like(asked: Asked, problem: DiagnosisProblem) -> RecalibratedCampaign:
    """Campaigns like what was ``asked`` about, of a ``problem`` whose baseline is recalibrated on it."""
    return RecalibratedCampaign(problem, asked.noise_levels(problem))
