"""Profile likelihood: how far one parameter can go when all others follow."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.fit.minimise import Minimiser, Minimum, Progress
from savgs_ident.fit.problem import Pins

PIN = 1e4
"""Weight that holds a coordinate: it gives way by chi2-sensitivity / PIN^2."""

STEPS = 6

CHI2_95 = 3.841458820694124
"""95 % point of chi2 with one degree of freedom."""


class ProfilePoint(NamedTuple):
    """chi2 (priors included) with the parameter held at ``value`` [its unit], all others refitted."""

    value: float
    chi2: float
    status: Status


class Profile(NamedTuple):
    """The profile likelihood of a parameter: its points by growing value, and the least chi2 known."""

    name: str
    points: tuple[ProfilePoint, ...]
    best: float


def held_at(
    minimiser: Minimiser, start: Minimum, name: str, coordinate: float, progress: Progress
) -> Minimum:
    """Refit everything with one parameter's unconstrained coordinate [1] held."""
    place = minimiser.problem.free.names.index(name)
    blank = jnp.zeros_like(start.u)
    pins = Pins(blank.at[place].set(PIN), blank.at[place].set(coordinate))
    moved = start.u.at[place].set(coordinate)
    return minimiser.minimise(moved, start.solution, STEPS, progress, pins)


def profile_likelihood(
    minimiser: Minimiser,
    best: Minimum,
    name: str,
    coordinates: Float[Array, " k"] | NDArray[np.float64],
    progress: Progress,
) -> Profile:
    """The profile of ``name`` at unconstrained ``coordinates`` [1], (k,), each refitted from its neighbour.

    Starts from the best fit outwards in both directions, so that warm starts stay close.
    """
    problem, place = minimiser.problem, minimiser.problem.free.names.index(name)
    middle = float(best.u[place])
    points = []
    for side in (-1.0, 1.0):
        at = best
        outward = [c for c in map(float, coordinates) if side * (c - middle) >= 0.0]
        for coordinate in sorted(outward, key=lambda c: abs(c - middle)):
            at = held_at(minimiser, at, name, coordinate, progress)
            value = float(problem.parameters(at.u)[name])
            points.append(ProfilePoint(value, at.cost, at.status))
    return Profile(name, tuple(sorted(set(points))), best.cost)


def lower_bound(minimiser: Minimiser, best: Minimum, name: str, progress: Progress) -> float | None:
    """The smallest value of a parameter within the 95 % region of its profile; None if there is none.

    Halves outward from the best fit until chi2 has risen by :data:`CHI2_95`, then bisects to 3 %.
    """
    problem, place = minimiser.problem, minimiser.problem.free.names.index(name)

    def rise(at: Minimum, coordinate: float) -> tuple[Minimum, float]:
        found = held_at(minimiser, at, name, coordinate, progress)
        return found, found.cost - best.cost

    inside, at = float(best.u[place]), best
    for _ in range(8):
        trial, gain = rise(at, inside - np.log(1.5))
        if not np.isfinite(gain) or gain > CHI2_95:
            break
        inside, at = inside - np.log(1.5), trial
    else:
        return None
    outside = inside - np.log(1.5)
    while inside - outside > 0.03:
        middle = 0.5 * (inside + outside)
        trial, gain = rise(at, middle)
        if np.isfinite(gain) and gain <= CHI2_95:
            inside, at = middle, trial
        else:
            outside = middle
    return float(problem.parameters(at.u)[name])
