"""A hypothesis at its best, and what it was held against.

:class:`LaplaceFit` is what every search for a maximum a posteriori (:mod:`savgs_ident.inference.find_map`) ends with,
:class:`Search` the plant and the data that it is about.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.core.threads import computed_once
from savgs_ident.inference.laplace import covariance_over_discrepancies
from savgs_ident.inference.likelihood import NoiseScales
from savgs_ident.inference.observations import Data, Plant, Prediction
from savgs_ident.inference.prior import Coordinates, values_at

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LaplaceFit:
    """A hypothesis at its best.

    Attributes:
        terms: names of the terms in it.
        coordinates: its n parameters.
        x: their coordinates [1], (n,).
        prediction: the plant there.
        slopes: slopes of the rows in the coordinates [unit of the row], (m, n).
        noise_scales: noise scale and discrepancy.
        value: log density of rows and prior there.
        precision: precision of the coordinates [1], (n, n).
        evidence: log evidence by Laplace's method, up to what all hypotheses share.
        status: how the search ended.
        precise: whether the plant was made as precise there as it can be.
    """

    terms: tuple[str, ...]
    coordinates: Coordinates
    x: Array
    prediction: Prediction
    slopes: Array
    noise_scales: NoiseScales
    value: float
    precision: Array
    evidence: float
    status: Status
    precise: bool = False

    @property
    def solved(self) -> bool:
        """Whether the plant was solved there, so that the evidence is a number."""
        return self.prediction.solved

    @property
    def values(self) -> dict[str, float]:
        """The parameters by name, SI."""
        return values_at(self.coordinates, self.x)

    def covariance(self) -> Array:
        """Covariance of the coordinates [1], (n, n), for the noise scale and the discrepancy at the mode."""
        return np.asarray(np.linalg.inv(self.precision), np.float64)


class Start(NamedTuple):
    """Where a search begins: parameters by name, SI, and what the plant is solved from there."""

    values: Mapping[str, float]
    warm_start: Any


@dataclass(frozen=True)
class Search:
    """A plant, what it is held against, and which rows count, (m,).

    Attributes:
        given: the parameters of the plant before the data, where hypotheses may be looked for from there, too.
    """

    plant: Plant
    data: Data
    mask: NDArray[np.bool_]
    given: Start | None = None

    def residual(self, prediction: Prediction) -> Array:
        """Measured less predicted [unit of the row], (m,)."""
        return self.data.measured - prediction.rows

    @computed_once
    def part(self) -> Data:
        """The data that count."""
        return self.data.part(self.mask)

    @property
    def rows(self) -> Data:
        """The same as independent rows."""
        return self.part.independent

    def turned(self, change: Array) -> Array:
        """A change of all rows [their units], (m,) or (m, n), as one of :attr:`rows`."""
        return self.part.turned(change[self.mask])

    def missed(self, prediction: Prediction) -> Array:
        """Measured less predicted, as independent rows."""
        return self.turned(self.residual(prediction))

    def covariance(self, fit: LaplaceFit) -> Array:
        """Covariance of a fit's coordinates [1], (n, n), over all discrepancies that the data allow.

        NaN where the plant was not solved.
        """
        if not fit.solved:
            return np.full((fit.x.size, fit.x.size), np.nan)
        missed, slopes = self.missed(fit.prediction), self.turned(fit.slopes)
        return covariance_over_discrepancies(self.rows, missed, slopes, fit.x, fit.noise_scales)

    def tolerated_errors(self, fit: LaplaceFit) -> Array:
        """The most probable errors within tolerances beside a fit, in their widths [1], (t,)."""
        tolerated = self.data.tolerated
        if tolerated is None:
            return np.zeros(0)
        scales = fit.noise_scales
        missed = self.missed(fit.prediction) / scales.spread
        return np.asarray(scales.noise**2 * self.turned(tolerated).T @ missed)

    def followed(self, fit: LaplaceFit) -> Array:
        """The rows of a fit [their units], (m,), with its most probable errors within tolerances, and nuisances."""
        rows = fit.prediction.rows
        if self.data.tolerated is not None:
            rows = rows + self.data.tolerated @ self.tolerated_errors(fit)
        return np.asarray(rows + self.data.explained_by_nuisances(self.data.measured - rows))


def search_of(plant: Plant, data: Data, given: Start | None = None) -> Search:
    """The search for which all rows count."""
    return Search(plant, data, np.ones(data.measured.size, bool), given)
