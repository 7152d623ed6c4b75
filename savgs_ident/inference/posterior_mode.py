"""The posterior's mode, with the small errors that any model has.

It is found by the same search as the hypotheses of a diagnosis (:mod:`savgs_ident.inference.find_map`); at the mode
the model is made as precise as it can be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress
from savgs_ident.core.status import Status
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.inference.find_map import LAST_STEPS, find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, Search, search_of
from savgs_ident.inference.likelihood import RowLikelihood
from savgs_ident.inference.near_mode import (
    LinearisationPoint,
    SampledProblem,
)
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.inference.prior import Coordinates, Prior, sheet_coordinate


@eqx.filter_jit
def _log_density(likelihood: RowLikelihood, prior: Prior, rows: Array, point: Array) -> Array:
    return likelihood(rows, point) + prior(point)


LEVEL = 0.01
"""Rise of the log density that a further step promises below which the mode is found."""


class PosteriorMode(NamedTuple):
    """The mode: what is known there, how the search ended, and whether the model was solved there."""

    linearisation_point: LinearisationPoint
    status: Status
    solved: bool


class PosteriorDensity(NamedTuple):
    """The density of a posterior: a problem with its likelihood and its prior."""

    problem: SampledProblem
    likelihood: RowLikelihood
    prior: Prior

    def density(self, rows: Float[np.ndarray, " m"], point: Float[np.ndarray, " n+2"]) -> float:
        """The log density of a point where the model has ``rows``."""
        return float(_log_density(self.likelihood, self.prior, jnp.asarray(rows), jnp.asarray(point)))


@dataclass(frozen=True)
class PosteriorPlant:
    """The model of a posterior, as the search for a mode asks for it; its motions are what it starts from nearby."""

    posterior: PosteriorDensity

    @property
    def nuisances(self) -> Coordinates:
        """The free parameters."""
        return tuple(sheet_coordinate(parameter) for parameter in self.posterior.problem.free.parameters)

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Rows at ``values`` [SI] with their slopes, from ``warm_start``. There are no ``terms``."""
        problem = self.posterior.problem
        u = problem.free.to_unconstrained(values)
        found = problem.linear_rows(self.posterior.likelihood, u, warm_start)
        by_value = found.slopes / np.asarray(problem.free.jacobian_diag(jnp.asarray(u)))
        return Prediction(found.rows, lambda: by_value, found.status, found.warm_start)

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        """What to start from nearby, made as precise as it can be. ``values`` are in SI."""
        problem = self.posterior.problem
        return problem.refined(problem.free.to_unconstrained(values), warm_start)

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """Nothing may be added."""
        return []


def find_mode(
    posterior: PosteriorDensity, u: Float[Array, " n"], warm_start: Any, report: Progress
) -> PosteriorMode:
    """The mode from free coordinates ``u`` (n,), where the model is solved from ``warm_start``."""
    search = search_of(PosteriorPlant(posterior), posterior.likelihood.data)
    start = _values_at(posterior, u)
    found = find_map(search, (), start, warm_start, steps=LAST_STEPS, level=LEVEL, progress=report)
    if found.status.ok:
        finer = search.plant.refined((), found.values, found.prediction.warm_start)
        found = find_map(search, (), found.values, finer, steps=LAST_STEPS, level=LEVEL, progress=report)
    return PosteriorMode(_linearisation_point(posterior, found), found.status, found.solved)


def with_background(
    posterior: PosteriorDensity, at: LinearisationPoint, drifting: Sequence[str]
) -> tuple[PosteriorDensity, Data]:
    """The density whose rows share the small errors that any model has about a point, and the data that say which.

    ``drifting`` are free parameters that may change while the recordings are made.
    """
    problem, likelihood, data = posterior.problem.with_background(posterior.likelihood, at, drifting)
    return PosteriorDensity(problem, likelihood, posterior.prior), data


NEAR = 1.0
"""Standard deviations by which a mode may lie off the point about which its background was found."""

PASSES = 4
"""Most points about which the background is found. Origin: computing time; one is the rule."""


class ModeWithBackground(NamedTuple):
    """A mode of rows that share small errors, found about itself.

    Attributes:
        density: that of these rows.
        data: what errors they share.
        search: what was searched.
        found: the mode.
        earlier: coordinates of the modes from other backgrounds [1], (k, n); none where the last is that of its own.
    """

    density: PosteriorDensity
    data: Data
    search: Search
    found: LaplaceFit
    earlier: Float[np.ndarray, "k n"]

    @property
    def settled(self) -> bool:
        """Whether the background was found about the mode."""
        return not self.earlier.size

    @property
    def covariance(self) -> Float[np.ndarray, "n n"]:
        """Covariance of the coordinates [1], of the backgrounds that lead elsewhere, too, where none settles."""
        own = self.search.covariance(self.found)
        off = self.earlier - self.found.x
        return own if self.settled else own + off.T @ off / len(off)

    @property
    def mode(self) -> PosteriorMode:
        """The mode, as a sampler takes it."""
        return PosteriorMode(
            _linearisation_point(self.density, self.found), self.found.status, self.found.solved
        )


def find_mode_with_background(
    plain: PosteriorDensity,
    at: LinearisationPoint,
    drifting: Sequence[str],
    report: Progress,
    level: float = LEVEL,
    known: tuple[PosteriorDensity, Data] | None = None,
) -> ModeWithBackground:
    """The mode with the small errors that any model has, from a point ``at`` that a search without them led to.

    What small errors do depends on how the model moves. Where the mode lies far from the point about which they were
    found, they are found again about the mode, until it stays; where it does not, no background is the right one, and
    all of their modes say what is known. Not where errors would have to be larger than small ones are. ``drifting``
    are free parameters that may change while the recordings are made. ``known`` is what :func:`with_background` gives
    about the first point, where that was asked for already.

    Raises :class:`InputError` where the errors do no finite thing.
    """
    modes: list[Float[np.ndarray, " n"]] = []
    for _ in range(PASSES):
        density, data = known or with_background(plain, at, drifting)
        known = None
        search = search_of(PosteriorPlant(density), density.likelihood.data)
        u = jnp.asarray(at.point[:-2])
        start = _values_at(density, u)
        found = find_map(search, (), start, at.warm_start, steps=LAST_STEPS, level=level, progress=report)
        if found.status is Status.MAX_ITERATIONS:
            # Along a contact as hard as any nothing rises any more, for as many steps as one likes.
            found = find_map(search, (), found.values, found.prediction.warm_start, progress=report)
        there = ModeWithBackground(density, data, search, found, np.array(modes).reshape(-1, found.x.size))
        if not found.solved or found.noise_scales.discrepancy > BACKGROUND.largest_error:
            break
        moved = (found.x - np.asarray(u) / plain.problem.free.widths) / np.sqrt(np.diag(found.covariance()))
        if np.max(np.abs(moved)) < NEAR:
            return there._replace(earlier=np.zeros((0, found.x.size)))
        modes.append(found.x)
        report("finding what small errors do there")
        at = linearisation_point(
            plain, jnp.asarray(found.x * plain.problem.free.widths), found.prediction.warm_start
        )
    return there


def _values_at(posterior: PosteriorDensity, u: Float[Array, " n"]) -> dict[str, float]:
    return {name: float(value) for name, value in posterior.problem.free.to_constrained(u).items()}


def _linearisation_point(posterior: PosteriorDensity, found: LaplaceFit) -> LinearisationPoint:
    widths = posterior.problem.free.widths
    scales = posterior.likelihood.scales.coordinates(found.noise_scales.noise, found.noise_scales.discrepancy)
    point = np.concatenate([found.x * widths, scales])
    rows = found.prediction.rows
    value = posterior.density(rows, point) if found.solved else -np.inf
    return LinearisationPoint(point, rows, found.slopes / widths, found.prediction.warm_start, value)


def linearisation_point(
    posterior: PosteriorDensity, u: Float[Array, " n"], warm_start: Any
) -> LinearisationPoint:
    """The model at free coordinates ``u`` (n,), solved as near ``warm_start``; noise as measured, no discrepancy."""
    found = posterior.problem.linear_rows(posterior.likelihood, u, warm_start)
    point = np.append(np.asarray(u), [0.0, 0.0])
    value = posterior.density(found.rows, point)
    return LinearisationPoint(point, found.rows, found.slopes, found.warm_start, value)
