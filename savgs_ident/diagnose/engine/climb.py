"""The mode of a hypothesis on the true, nonlinear plant, and its evidence.

A step goes to the best point of the linearisation, noise scale and discrepancy included, so that a hypothesis
that misses weighs its rows by what it can explain from the first step on; it is halved until the density rises.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.diagnose.engine.coordinates import Coordinates, reach_of, slopes_at, values_at
from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.engine.linear import best_of, log_determinant
from savgs_ident.diagnose.engine.misfit import Misfit, misfit_of
from savgs_ident.diagnose.engine.prediction import Plant, Prediction, Term

STEPS = 15
"""Most steps to a mode."""

HALVINGS = 5
"""Most halvings of a step that does not rise."""

LEVEL = 0.1
"""Rise of the log density that a step promises below which the mode is found."""

ROUGH = 2.0
"""Rise that is promised, but not found, up to which a mode is as good: friction makes the density rough."""


@dataclass(frozen=True)
class Mode:
    """A hypothesis at its best.

    Attributes:
        terms: names of the terms in it.
        coordinates: its n parameters.
        x: their coordinates [1], (n,).
        prediction: the plant there.
        slopes: slopes of the rows in the coordinates [unit of the row], (m, n).
        misfit: noise scale and discrepancy.
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
    misfit: Misfit
    precision: NDArray[np.float64]
    evidence: float
    status: Status
    precise: bool = False

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
    kept: NDArray[np.bool_]

    def residual(self, prediction: Prediction) -> NDArray[np.float64]:
        """Measured less predicted [unit of the row], (m,)."""
        return self.data.measured - prediction.rows

    def part(self) -> Data:
        """The data that count."""
        data, kept = self.data, self.kept
        return Data(data.measured[kept], data.variance[kept], data.reach[kept], data.test[kept])


def search_of(plant: Plant, data: Data, kept: NDArray[np.bool_] | None = None) -> Search:
    """All rows count unless ``kept`` (m,) says which."""
    return Search(plant, data, np.ones(data.measured.size, bool) if kept is None else kept)


def climb(
    search: Search, terms: tuple[Term, ...], start: Mapping[str, float], near: Any, steps: int = STEPS
) -> Mode:
    """The mode of the baseline with ``terms`` from ``start`` (SI, centres where not given)."""
    coordinates = search.plant.nuisances + tuple(c for term in terms for c in term.coordinates)
    names = tuple(term.name for term in terms)
    lower, upper = reach_of(coordinates)
    x = np.clip([c.at(start.get(c.name, c.centre)) for c in coordinates], lower, upper)

    def at(x: NDArray[np.float64], near: Any) -> Prediction:
        wanted = [coordinate.name for coordinate in coordinates]
        return search.plant.predict(names, values_at(coordinates, x), wanted, near)

    part = search.part()
    here, status = at(x, near), Status.MAX_ITERATIONS
    value = _value(part, search, here, x)
    for _ in range(steps):
        slopes = here.slopes * slopes_at(coordinates, x)
        top = best_of(search.data, search.residual(here), slopes, x, (lower, upper), search.kept)
        if top.value - value < LEVEL:
            status = Status.CONVERGED
            break
        for halving in range(HALVINGS):
            there = x + 0.5**halving * (top.x - x)
            tried = at(there, here.near)
            found = _value(part, search, tried, there)
            if found > value:
                break
        else:
            status = Status.CONVERGED if top.value - value < ROUGH else Status.STALLED
            break
        x, here, value = there, tried, found
    return _mode(search, names, coordinates, x, here, value, status)


def refine(search: Search, mode: Mode, terms: tuple[Term, ...]) -> Mode:
    """The mode again, with the plant made as precise there as it can be."""
    near = search.plant.refined(mode.terms, mode.values, mode.prediction.near)
    return replace(climb(search, terms, mode.values, near), precise=True)


def _value(part: Data, search: Search, prediction: Prediction, x: NDArray[np.float64]) -> float:
    """Log density of rows and prior; minus infinity where the plant was not solved."""
    if not (prediction.solved and np.isfinite(prediction.rows).all()):
        return -np.inf
    return misfit_of(part, search.residual(prediction)[search.kept]).value - 0.5 * float(x @ x)


def _mode(
    search: Search,
    names: tuple[str, ...],
    coordinates: Coordinates,
    x: NDArray[np.float64],
    here: Prediction,
    value: float,
    status: Status,
) -> Mode:
    if not np.isfinite(value):
        status = Status.NOT_FINITE
    slopes = here.slopes * slopes_at(coordinates, x)
    misfit = misfit_of(search.part(), search.residual(here)[search.kept])
    across = slopes[search.kept]
    precision = np.eye(x.size) + (across.T / misfit.spread) @ across
    evidence = -np.inf
    if np.isfinite(value):
        evidence = value - 0.5 * log_determinant(precision) + log(2.0) * sum(c.halved for c in coordinates)
    return Mode(names, coordinates, x, here, slopes, misfit, precision, evidence, status)
