"""The posterior's mode, and what a sampler proposes from: a surrogate to second order about it.

The mode is found by the same search as the hypotheses of a diagnosis (:mod:`savgs_ident.inference.find_map`); at the
mode the model is made as precise as it can be. Its normal approximation gives the scale of the posterior about a
point, in which it is round for the samplers; second derivatives are differences of exact slopes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.executor import in_parallel
from savgs_ident.core.presentation import Progress
from savgs_ident.core.status import Status
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.inference.find_map import LAST_STEPS, find_map
from savgs_ident.inference.laplace import principal_axes
from savgs_ident.inference.laplace_fit import LaplaceFit, Search, search_of
from savgs_ident.inference.likelihood import RowLikelihood
from savgs_ident.inference.near_mode import (
    PLACES,
    ExactModel,
    LinearisationPoint,
    SampledProblem,
    Surrogate,
    bend_of,
    curve_of,
    identity_map,
    no_bend,
    no_curve,
    triangular_map_of,
)
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.inference.prior import Coordinates, Prior, sheet_coordinate
from savgs_ident.inference.straightened import straightened_about

LONGEST = 1.0
"""Longest axis [unconstrained coordinates]: an e-fold of an identified parameter, a tolerance of the others. A
direction that the data do not identify is explored by as much."""

LEAST = 1e-4
"""Least standard deviation of a scale's coordinate."""

_NOISE_GRID = np.linspace(-4.0, 4.0, 161)
"""Coordinates of the noise's scale about that of the mode, which lies far off where the model misses by far."""
_MISS_GRID = np.concatenate([[0.0], np.geomspace(1e-5, 30.0, 300)])
"""Coordinates of the discrepancy, or multiples of that of the mode where it is above one."""


def parameter_scale(
    likelihood: RowLikelihood, prior: Prior, point: Float[Array, " n+2"], slopes: Float[np.ndarray, "m n"]
) -> Float[np.ndarray, "n n"]:
    """Columns along the principal axes of the parameters' information at ``point``, one sd long each, or shorter."""
    count = slopes.shape[1]
    weight = 1.0 / np.sqrt(np.asarray(likelihood.spread(point)))
    curvature = -np.diag(np.asarray(jax.hessian(prior)(point)))[:count]
    stacked = np.concatenate([slopes * weight[:, None], np.diag(np.sqrt(np.maximum(curvature, 0.0)))])
    return principal_axes(stacked, LONGEST)


def nuisance_scale(
    likelihood: RowLikelihood,
    prior: Prior,
    point: Float[Array, " n+2"],
    rows: Float[np.ndarray, " m"],
    scatter: Float[np.ndarray, " m"],
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Means and standard deviations of the noise's and the discrepancy's coordinate, given all others.

    The discrepancy's density is even in its coordinate. Where it stands clear of zero one of its two halves
    is taken, elsewhere both together, as wide as they are where ``rows`` of the mode miss by their ``scatter`` (m,)
    over the posterior besides: at the mode they miss least, and leave the least room for it.
    """
    measured = np.asarray(likelihood.measured)

    def moments(place: int, grid: np.ndarray, modelled: np.ndarray = rows) -> tuple[float, float]:
        along = _along(point, place, grid)
        logs = np.asarray(_log_densities(likelihood, prior, jnp.asarray(modelled), along))
        mass = np.exp(logs - logs.max()) * np.gradient(grid)
        mass /= mass.sum()
        mean = float(mass @ grid)
        # A density narrower than the grid still has a width.
        return mean, max(float(np.sqrt(mass @ (grid - mean) ** 2)), LEAST)

    level, size = (float(each) for each in np.asarray(point)[-2:])
    missing = _MISS_GRID * max(1.0, abs(size))
    noise, miss = moments(-2, level + _NOISE_GRID), moments(-1, missing)
    if miss[0] < 3.0 * miss[1]:
        anywhere = measured + np.hypot(rows - measured, scatter)
        miss = (0.0, float(np.hypot(*moments(-1, missing, anywhere))))
    return np.array([noise[0], miss[0]]), np.array([noise[1], miss[1]])


@eqx.filter_jit
def _log_density(likelihood: RowLikelihood, prior: Prior, rows: Array, point: Array) -> Array:
    return likelihood(rows, point) + prior(point)


@eqx.filter_jit
def _log_densities(likelihood: RowLikelihood, prior: Prior, rows: Array, points: Array) -> Array:
    return jax.vmap(lambda point: likelihood(rows, point) + prior(point))(points)


def _along(point: Array, place: int, grid: np.ndarray) -> Array:
    """Copies of a point with one coordinate on a grid, (grid, n + 2)."""
    return jnp.tile(point, (grid.size, 1)).at[:, place].set(jnp.asarray(grid))


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


def linear_surrogate(posterior: PosteriorDensity, at: LinearisationPoint) -> Surrogate:
    """The surrogate about a linearisation point, without second derivatives."""
    point = jnp.asarray(at.point)
    scale = np.zeros((point.size, point.size))
    scale[:-2, :-2] = parameter_scale(posterior.likelihood, posterior.prior, point, at.slopes)
    slope = at.slopes @ scale[:-2, :-2]
    scatter = np.linalg.norm(slope, axis=1)
    means, spreads = nuisance_scale(posterior.likelihood, posterior.prior, point, at.rows, scatter)
    scale[[-2, -1], [-2, -1]] = spreads
    return Surrogate(
        likelihood=posterior.likelihood,
        prior=posterior.prior,
        straightened=straightened_about(posterior.prior.free, np.concatenate([at.point[:-2], means])),
        scale=jnp.asarray(scale),
        rows=jnp.asarray(at.rows),
        slope=jnp.asarray(slope),
        bend=no_bend(at.rows.size),
        curve=no_curve(slope.shape[1], at.rows.size),
        map=identity_map(slope.shape[1]),
        middle=jnp.zeros(point.size),
        width=jnp.ones(point.size),
    )


BENT = 0.5
"""Second derivative [noise sd] beyond which an axis is explored to its other side too."""


CURVED = 0.1
"""Second derivative [noise sd] beyond which rows along an axis are exact further out, too. Origin: three standard
deviations away it makes half a one of the rows."""


class Expansion(NamedTuple):
    """The model about a point: exact near it, and a surrogate to second order."""

    exact: ExactModel
    surrogate: Surrogate


def expand(posterior: PosteriorDensity, at: LinearisationPoint, report: Progress) -> Expansion:
    """The expansion about a linearisation point."""
    linear = linear_surrogate(posterior, at)
    axes = np.asarray(linear.scale)[:-2, :-2]
    weight = 1.0 / np.sqrt(np.asarray(posterior.likelihood.spread(linear.centre)))
    report(f"second derivatives of the response along {axes.shape[1]} axes")
    exact = posterior.problem.exact(posterior.likelihood, jnp.asarray(at.point[:-2]), at.warm_start)
    second = _second_derivatives(posterior, at, exact, linear, weight)
    bent = (bend_of(second, weight), triangular_map_of(second, np.asarray(linear.slope), weight))
    quadratic: Surrogate = eqx.tree_at(lambda each: (each.bend, each.map), linear, bent)
    own = np.linalg.norm(np.einsum("iim->im", second) * weight, axis=1)
    axes_that_bend = np.flatnonzero(own > CURVED)
    report(f"responses further out along {axes_that_bend.size} axes that bend")
    left = _left_along_axes(exact, quadratic, axes_that_bend)
    return Expansion(exact, eqx.tree_at(lambda each: each.curve, quadratic, curve_of(left, weight)))


def _left_along_axes(
    exact: ExactModel, surrogate: Surrogate, bent: Float[np.ndarray, " b"]
) -> Float[np.ndarray, "n 6 m"]:
    """What a surrogate leaves of the rows at the places along its axes, of those that ``bent``.

    Where the model is not solved, further out than the last place where it was, as much as there, by v^2.
    """
    count = surrogate.slope.shape[1]
    left = np.zeros((count, PLACES.size, surrogate.rows.size))
    if not bent.size:
        return left
    v = np.zeros((bent.size, PLACES.size, count + 2))
    v[np.arange(bent.size), :, bent] = PLACES
    points, made_up = (np.asarray(each) for each in _at(surrogate, jnp.asarray(v.reshape(-1, count + 2))))
    rows, solved = exact.rows(points[:, :-2])
    left[bent] = np.where(solved[:, None], rows - made_up, np.nan).reshape(bent.size, PLACES.size, -1)
    middle = PLACES.size // 2
    for outward in (range(middle, PLACES.size), range(middle - 1, -1, -1)):
        inner = np.zeros((count, surrogate.rows.size))
        for place in outward:
            inner = np.where(np.isfinite(left[:, place]), left[:, place] / PLACES[place] ** 2, inner)
            left[:, place] = inner * PLACES[place] ** 2
    return left


@eqx.filter_jit
def _at(surrogate: Surrogate, v: Array) -> tuple[Array, Array]:
    """Points and rows of a surrogate at ``v`` (w, n + 2) in standard deviations."""
    points = jax.vmap(lambda each: surrogate.straightened.points(surrogate.scale @ each))(v)
    return points, jax.vmap(surrogate.rows_at)(v[:, :-2])


def _second_derivatives(
    posterior: PosteriorDensity,
    at: LinearisationPoint,
    exact: ExactModel,
    linear: Surrogate,
    weight: Float[np.ndarray, " m"],
) -> Float[np.ndarray, "n n m"]:
    """Differences of the slopes one standard deviation ahead; of both sides where an axis bends much.

    An axis whose sides were not solved counts as straight: the exact model decides in the end.
    """
    axes, straightened = np.asarray(linear.scale)[:-2, :-2], linear.straightened

    def slopes_at(shift: np.ndarray) -> np.ndarray | None:
        y = jnp.append(jnp.asarray(shift), jnp.zeros(2))
        u = straightened.points(y)[:-2]
        found = posterior.problem.linear_rows(posterior.likelihood, u, at.warm_start, exact.predicted(u))
        by_axis = (found.slopes * np.asarray(straightened.slopes(y))[:-2]) @ axes
        return np.asarray(by_axis.T) if found.status.ok else None

    here = (at.slopes @ axes).T
    ahead = in_parallel(slopes_at, axes.T)
    second = np.stack([np.zeros_like(here) if each is None else each - here for each in ahead])
    bent = [
        axis
        for axis, each in enumerate(ahead)
        if each is None or not np.linalg.norm(second[axis, axis] * weight) < BENT
    ]
    for axis, behind in zip(bent, in_parallel(slopes_at, [-axes.T[axis] for axis in bent]), strict=True):
        if behind is None:
            second[axis] = 0.0
        else:
            second[axis] = here - behind if ahead[axis] is None else 0.5 * (second[axis] + here - behind)
    return np.nan_to_num(second)
