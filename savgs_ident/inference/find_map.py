"""The maximum a posteriori of a hypothesis on the true, nonlinear plant, and its Laplace approximation.

One search serves the hypotheses of a diagnosis and the mode and the profiles of a posterior. A step goes to the
best point of the linearisation, noise scale and discrepancy included, so that a hypothesis that misses weighs its
rows by what it can explain from the first step on; it is halved until the density rises. At the end stands the
evidence by Laplace's method: a normal density with the precision I + J' W J of the coordinates, W one over the
rows' variance.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress
from savgs_ident.core.status import Status
from savgs_ident.inference.laplace import log_evidence, precision_of
from savgs_ident.inference.noise_scales import NoiseScales, linearised_optimum, noise_scales
from savgs_ident.inference.observations import Data, Plant, Prediction, Term
from savgs_ident.inference.prior import Coordinates, bounds_of, slopes_at, values_at

STEPS = 15
"""Most steps to a mode."""

HALVINGS = 5
"""Most halvings of a step that does not rise."""

LEVEL = 0.1
"""Rise of the log density that a step promises below which the mode is found."""

ROUGH = 2.0
"""Rise that is promised, but not found, up to which a mode is as good: friction makes the density rough."""


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
    x: NDArray[np.float64]
    prediction: Prediction
    slopes: NDArray[np.float64]
    noise_scales: NoiseScales
    value: float
    precision: NDArray[np.float64]
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

    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the coordinates [1], (n, n)."""
        return np.asarray(np.linalg.inv(self.precision), np.float64)


@dataclass(frozen=True)
class Search:
    """A plant, what it is held against, and which rows count, (m,)."""

    plant: Plant
    data: Data
    mask: NDArray[np.bool_]

    def residual(self, prediction: Prediction) -> NDArray[np.float64]:
        """Measured less predicted [unit of the row], (m,)."""
        return self.data.measured - prediction.rows

    @cached_property
    def part(self) -> Data:
        """The data that count."""
        return self.data.part(self.mask)

    @property
    def rows(self) -> Data:
        """The same as independent rows."""
        return self.part.independent

    def turned(self, change: NDArray[np.float64]) -> NDArray[np.float64]:
        """A change of all rows [their units], (m,) or (m, n), as one of :attr:`rows`."""
        return self.part.turned(change[self.mask])

    def missed(self, prediction: Prediction) -> NDArray[np.float64]:
        """Measured less predicted, as independent rows."""
        return self.turned(self.residual(prediction))


def search_of(plant: Plant, data: Data, mask: NDArray[np.bool_] | None = None) -> Search:
    """All rows count unless ``mask`` (m,) says which."""
    return Search(plant, data, np.ones(data.measured.size, bool) if mask is None else mask)


def find_map(
    search: Search,
    terms: tuple[Term, ...],
    start: Mapping[str, float],
    warm_start: Any,
    steps: int = STEPS,
    level: float = LEVEL,
    held: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> LaplaceFit:
    """The mode of the baseline with ``terms`` from ``start`` (SI, centres where not given).

    The parameters ``held`` (SI, by name) stay where they are said to be. The mode is found where a step promises a
    rise of less than ``level``. ``progress`` is called with the density at every step.
    """
    coordinates = search.plant.nuisances + tuple(c for term in terms for c in term.coordinates)
    names = tuple(term.name for term in terms)
    start, fixed = {**start, **(held or {})}, np.array([c.name in (held or {}) for c in coordinates])
    lower, upper = bounds_of(coordinates)
    x = np.clip([c.at(start[c.name]) if c.name in start else 0.0 for c in coordinates], lower, upper)
    lower, upper = np.where(fixed, x, lower), np.where(fixed, x, upper)

    def at(x: NDArray[np.float64], warm_start: Any) -> Prediction:
        wanted = [coordinate.name for coordinate in coordinates]
        found = search.plant.predict(names, values_at(coordinates, x), wanted, warm_start)
        if found.solved and not (np.isfinite(found.rows).all() and np.isfinite(found.slopes).all()):
            return found._replace(status=Status.NOT_FINITE)
        return found

    here, status = at(x, warm_start), Status.MAX_ITERATIONS
    value = _value(search, here, x)
    for count in range(1, steps + 1):
        if not here.solved:
            break
        if progress:
            progress(f"looking for the mode, step {count}: log density {value:.2f}")
        slopes = search.turned(here.slopes * slopes_at(coordinates, x))
        top = linearised_optimum(
            search.rows, search.missed(here), slopes, x, (lower, upper), min(1e-3, 0.1 * level)
        )
        if top.value - value < level:
            status = Status.CONVERGED if top.converged else Status.STALLED
            break
        for halving in range(HALVINGS):
            there = x + 0.5**halving * (top.x - x)
            tried = at(there, here.warm_start)
            found = _value(search, tried, there)
            if found > value:
                break
        else:
            rough = top.value - value < ROUGH
            status = Status.CONVERGED if rough else Status.STALLED
            break
        x, here, value = there, tried, found
    return _mode(search, names, coordinates, x, here, value, status)


def refine(search: Search, mode: LaplaceFit, terms: tuple[Term, ...]) -> LaplaceFit:
    """The mode again, with the plant made as precise there as it can be."""
    warm_start = search.plant.refined(mode.terms, mode.values, mode.prediction.warm_start)
    return replace(find_map(search, terms, mode.values, warm_start), precise=True)


def _value(search: Search, prediction: Prediction, x: NDArray[np.float64]) -> float:
    """Log density of rows and prior; minus infinity where the plant was not solved."""
    if not prediction.solved:
        return -np.inf
    return noise_scales(search.rows, search.missed(prediction)).value - 0.5 * float(x @ x)


def _mode(
    search: Search,
    names: tuple[str, ...],
    coordinates: Coordinates,
    x: NDArray[np.float64],
    here: Prediction,
    value: float,
    status: Status,
) -> LaplaceFit:
    slopes = here.slopes * slopes_at(coordinates, x)
    misfit = noise_scales(search.rows, search.missed(here))
    precision = precision_of(search.turned(slopes), misfit.spread)
    evidence = log_evidence(value, precision, coordinates) if here.solved else -np.inf
    status = status if here.solved else here.status
    return LaplaceFit(names, coordinates, x, here, slopes, misfit, value, precision, evidence, status)
