"""The shape of a surrogate about its highest point: the mode, its curvature, and profiles of what is identified.

It needs no draws, so it is found while the chains run.
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

from savgs_ident.core.status import Status
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, search_of
from savgs_ident.inference.likelihood import values_of
from savgs_ident.inference.near_mode import Surrogate
from savgs_ident.inference.observations import Prediction, Term
from savgs_ident.inference.posterior_mode import PosteriorDensity
from savgs_ident.inference.prior import NUISANCE, Coordinates, sheet_coordinate
from savgs_ident.inference.result import ProfileLine

SPAN = 3.0
"""How far profiles reach to either side [standard deviations]."""

STEPS = 6
"""Points of a profile to either side."""

SURROGATE_STEPS = 60
SURROGATE_LEVEL = 1e-5


@dataclass(frozen=True)
class SurrogatePlant:
    """A surrogate, as the search for a mode asks for it: nothing has to be solved, and it is solved everywhere."""

    surrogate: Surrogate

    @property
    def nuisances(self) -> Coordinates:
        """The free parameters."""
        return tuple(sheet_coordinate(parameter) for parameter in self.surrogate.prior.free.parameters)

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: None
    ) -> Prediction:
        """Rows at ``values`` [SI] with their slopes. There are no ``terms``."""
        surrogate, free = self.surrogate, self.surrogate.prior.free
        u = np.asarray(free.to_unconstrained(values))
        axes = np.asarray(surrogate.scale)[: u.size, : u.size]
        y, along = (np.asarray(each) for each in _straightened(surrogate, jnp.asarray(u)))
        v = np.linalg.solve(axes, y)
        rows, slopes = (np.asarray(each) for each in _rows_and_slopes(surrogate, jnp.asarray(v)))
        by_value = np.linalg.solve(axes.T, slopes.T).T / along
        return Prediction(rows, lambda: by_value, Status.CONVERGED, None)

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: None) -> None:
        """Nothing is started from nearby. Values are in SI."""
        return

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """Nothing may be added."""
        return []


def surrogate_mode(
    surrogate: Surrogate, start: Mapping[str, float] | None = None, held: Mapping[str, float] | None = None
) -> LaplaceFit:
    """Where a surrogate is highest, with the parameters ``held`` [SI] where they are said to be.

    Looked for from ``start`` [SI], its centre if not given.
    """
    free, size = surrogate.prior.free, len(surrogate.prior.free.names)
    if start is None:
        start = {name: float(value) for name, value in free.to_constrained(surrogate.centre[:size]).items()}
    search = search_of(SurrogatePlant(surrogate), surrogate.likelihood.data)
    return find_map(search, (), start, None, SURROGATE_STEPS, SURROGATE_LEVEL, held)


def profile_of(surrogate: Surrogate, name: str, best: LaplaceFit) -> ProfileLine:
    """The profile of a parameter about the ``best`` point; a point at which the search failed is left out."""
    free = surrogate.prior.free
    place = free.names.index(name)
    coordinate = sheet_coordinate(free.parameters[place])
    along = np.asarray(surrogate.scale)[place] * np.asarray(surrogate.width)
    sd = float(np.linalg.norm(along)) / free.widths[place]
    found = {best.values[name]: 0.0}
    for side in (-1.0, 1.0):
        last = best
        for deviation in side * SPAN * np.arange(1, STEPS + 1) / STEPS:
            value = coordinate.value(float(best.x[place]) + float(deviation) * sd)
            held = surrogate_mode(surrogate, last.values, {name: value})
            if held.status.ok:
                found[value] = 2.0 * (best.value - held.value)
                last = held
    values = np.array(sorted(found))
    return ProfileLine(values, np.array([found[each] for each in values]))


class Shape(NamedTuple):
    """A surrogate about its highest point, by names of parameters.

    Attributes:
        values: the parameters there, each in its unit.
        sd: standard deviations that the curvature there promises, each in its unit.
        profiles: of the identified parameters.
    """

    values: Mapping[str, float]
    sd: Mapping[str, float]
    profiles: Mapping[str, ProfileLine]


def shape_of(posterior: PosteriorDensity, surrogate: Surrogate) -> Shape:
    """The shape of a surrogate; it takes seconds, and no draws are needed."""
    free, scales = posterior.problem.free, posterior.likelihood.scales
    best = surrogate_mode(surrogate)
    point = np.concatenate(
        [best.x * free.widths, scales.coordinates(best.noise_scales.noise, best.noise_scales.discrepancy)]
    )
    return Shape(
        values={name: float(value[0]) for name, value in values_of(free, scales, point[None]).items()},
        sd=_laplace_sd(posterior, surrogate, point),
        profiles={name: profile_of(surrogate, name, best) for name in free.identified},
    )


_STEP = 1e-5
"""Step of a coordinate for the slope of a value."""


def _laplace_sd(
    posterior: PosteriorDensity, surrogate: Surrogate, point: Float[np.ndarray, " n+2"]
) -> dict[str, float]:
    """Standard deviations from the curvature at the surrogate's highest point, each in its unit."""
    # Where no discrepancy is best, beside the symmetry plane: the magnitude has no second derivative there.
    point = np.append(point[:-1], max(point[-1], _STEP))
    t = jnp.asarray(surrogate.coordinates(point[None])[0])
    information, slopes = -np.asarray(_hessian(surrogate, t)), np.asarray(_point_slopes(surrogate, t))
    sizes, axes = np.linalg.eigh(information)
    spread = slopes @ (axes / np.sqrt(np.where(sizes > 0.0, sizes, np.nan)))
    deviation = np.sqrt(np.sum(spread**2, axis=1))
    found = {}
    for place, name in enumerate((*posterior.problem.free.names, *NUISANCE)):
        # Away from zero, where the discrepancy, a magnitude, has a kink.
        step = np.copysign(_STEP, point[place]) * np.eye(1, point.size, place)
        moved = values_of(
            posterior.problem.free, posterior.likelihood.scales, np.concatenate([point[None], point + step])
        )
        found[name] = float(abs(np.diff(moved[name])[0]) / _STEP * deviation[place])
    return found


@eqx.filter_jit
def _straightened(surrogate: Surrogate, u: Array) -> tuple[Array, Array]:
    """Straightened coordinates of ``u`` (n,), and d value / dy there [SI unit of each value], (n,) each."""
    y = surrogate.straightened.coordinates(jnp.append(u, surrogate.centre[u.size :]))
    slopes = surrogate.straightened.slopes(y)[: u.size] * surrogate.prior.free.jacobian_diag(u)
    return y[: u.size], slopes


@eqx.filter_jit
def _rows_and_slopes(surrogate: Surrogate, v: Array) -> tuple[Array, Array]:
    return surrogate.rows_at(v), jax.jacfwd(surrogate.rows_at)(v)


@eqx.filter_jit
def _hessian(surrogate: Surrogate, t: Array) -> Array:
    return jax.hessian(surrogate.of_point)(t)


@eqx.filter_jit
def _point_slopes(surrogate: Surrogate, t: Array) -> Array:
    return jax.jacfwd(surrogate.point)(t)
