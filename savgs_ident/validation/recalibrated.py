"""A recorded campaign with its baseline recalibrated, and campaigns like it whose truth is known.

The truth of each has parameters drawn from what the recorded campaign leaves open about them. Its response is
computed on nodes of its own, so that what finitely many of them cost is not the same in truth and model; it gets the
noise and the small errors that the recorded one has, of which a diagnosis knows no more than there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.evidence import DiagnosisProblem
from savgs_ident.inference.find_map import find_map, refine
from savgs_ident.inference.laplace_fit import search_of
from savgs_ident.inference.prior import bounds_of, values_at
from savgs_ident.responses.harmonic_response import HarmonicResponse


@dataclass(frozen=True)
class RecalibratedCampaign:
    """A recorded campaign, recalibrated: what campaigns like it are drawn from.

    Attributes:
        problem: the campaign, its baseline recalibrated.
        dof: degrees of freedom of the noise level behind each row, (m,); infinite where it is known.
        level: which level that is, a channel of a test, (m,).
    """

    problem: DiagnosisProblem
    dof: NDArray[np.float64]
    level: NDArray[np.intp]

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
        measured = rows + known.data.draw_errors(scales.noise, scales.discrepancy, random)
        data = replace(known.data, measured=measured, variance=self._estimated_variance(random))
        search = search_of(known.plant, data)
        base = find_map(search, (), known.base.values, known.base.prediction.warm_start)
        if not base.solved:
            return None
        return replace(
            known, data=data, search=search, given=base.prediction.rows, base=refine(search, base, ())
        )

    def _estimated_variance(self, random: np.random.Generator) -> NDArray[np.float64]:
        """The variances (m,) as a record of the same length would show them."""
        _, first, level = np.unique(self.level, return_index=True, return_inverse=True)
        dof = self.dof[first]
        known = np.isinf(dof)
        shown = np.where(known, 1.0, random.chisquare(np.where(known, 1.0, dof)) / np.where(known, 1.0, dof))
        return np.asarray(self.problem.data.variance * shown[level])


def campaigns_like(measured: HarmonicResponse, problem: DiagnosisProblem) -> RecalibratedCampaign:
    """Campaigns like a measured response, of a ``problem`` whose baseline is recalibrated on it."""
    level = problem.data.test * len(problem.plant.channels) + problem.plant.channel
    return RecalibratedCampaign(problem, _degrees_of_freedom(measured, problem), level)


def _degrees_of_freedom(measured: HarmonicResponse, problem: DiagnosisProblem) -> NDArray[np.float64]:
    """Of the noise level behind each row, (m,)."""
    if measured.covariance_dof is None:
        return np.full(problem.data.measured.size, np.inf)
    channels = enumerate(problem.plant.channels)
    first = {c: measured.channel(name) for c, name in channels if name in measured.channels}
    places = np.array([first[channel] for channel in problem.plant.channel])
    return np.asarray(measured.covariance_dof[problem.data.test, places, 1])
