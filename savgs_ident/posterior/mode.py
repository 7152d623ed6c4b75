"""The posterior's mode.

A step goes to the top of the linear surrogate, noise scale and discrepancy included, so that a model that
misses weighs its entries by what it can explain from the first step on; it is halved until the exact density
rises. At the mode the time nodes are adapted once more.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.status import Status
from savgs_ident.fit.problem import Problem
from savgs_ident.posterior.ascend import ascend
from savgs_ident.posterior.exact import rows_and_slopes
from savgs_ident.posterior.laplace import nuisance_scale, parameter_scale
from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.posterior.prior import Prior
from savgs_ident.posterior.shear import no_shear
from savgs_ident.posterior.surrogate import Surrogate, no_bend
from savgs_ident.simulate.periodic import PeriodicSolution, adapt

Progress = Callable[[str], None]
"""Is told what is going on, a line at a time."""

STEPS = 20
"""Most steps to the mode."""

HALVINGS = 6
"""Most halvings of a step that does not rise."""

LEVEL = 0.01
"""Rise of the log density that a further step promises below which the mode is found."""

ROUGH = 1.0
"""Rise that is promised, but not found, up to which the mode is as good: friction makes the density rough."""


class Foothold(NamedTuple):
    """The model at a point: rows (m,), their slopes (m, n) in u, motions, and the exact log density."""

    point: Float[np.ndarray, " n+2"]
    rows: Float[np.ndarray, " m"]
    slopes: Float[np.ndarray, "m n"]
    solution: PeriodicSolution
    value: float


class Mode(NamedTuple):
    """The mode: a foothold there, and how the search ended."""

    foothold: Foothold
    status: Status


class Case(NamedTuple):
    """A problem with its likelihood and its prior."""

    problem: Problem
    likelihood: Likelihood
    prior: Prior

    def density(self, rows: Float[np.ndarray, " m"], point: Float[np.ndarray, " n+2"]) -> float:
        """The log density of a point where the model has ``rows``."""
        x = jnp.asarray(point)
        return float(self.likelihood(jnp.asarray(rows), x) + self.prior(x))


def find_mode(case: Case, u: Float[Array, " n"], near: PeriodicSolution, tell: Progress) -> Mode:
    """The mode from free coordinates ``u`` (n,), where the model has the motions ``near``.

    Its nodes are adapted there.
    """
    mode = _climb(case, _first_foothold(case, u, near), tell)
    if not mode.status.ok:
        return mode
    point, known = mode.foothold.point, mode.foothold.solution
    p = case.problem.parameters(jnp.asarray(point[:-2]))
    finer = adapt(case.problem.model, p, known, known.mesh.layout, case.problem.iterations)
    return _climb(case, _first_foothold(case, jnp.asarray(point[:-2]), finer), tell)


def linear_surrogate(case: Case, at: Foothold) -> Surrogate:
    """The surrogate about a foothold without second derivatives."""
    point = jnp.asarray(at.point)
    means, spreads = nuisance_scale(case.likelihood, case.prior, point, at.rows)
    scale = np.zeros((point.size, point.size))
    scale[:-2, :-2] = parameter_scale(case.likelihood, case.prior, point, at.slopes)
    scale[[-2, -1], [-2, -1]] = spreads
    slope = at.slopes @ scale[:-2, :-2]
    return Surrogate(
        likelihood=case.likelihood,
        prior=case.prior,
        centre=jnp.asarray(np.concatenate([at.point[:-2], means])),
        scale=jnp.asarray(scale),
        rows=jnp.asarray(at.rows),
        slope=jnp.asarray(slope),
        bend=no_bend(at.rows.size),
        shear=no_shear(slope.shape[1]),
    )


def _first_foothold(case: Case, u: Array, near: PeriodicSolution) -> Foothold:
    rows, slopes, solution = rows_and_slopes(case.problem, case.likelihood, u, near)
    blank = np.concatenate([np.asarray(u), np.zeros(2)])
    means, _ = nuisance_scale(case.likelihood, case.prior, jnp.asarray(blank), rows)
    point = np.concatenate([np.asarray(u), means])
    return Foothold(point, rows, slopes, solution, case.density(rows, point))


def _climb(case: Case, at: Foothold, tell: Progress) -> Mode:
    for count in range(1, STEPS + 1):
        if not np.isfinite(at.value):
            return Mode(at, Status.NOT_FINITE)
        linear = linear_surrogate(case, at)
        here = linear.coordinates(at.point[None])[0]
        top = ascend(linear, here)
        if not top.found:
            return Mode(at, Status.STALLED)
        tell(f"looking for the mode, step {count}: log density {at.value:.2f}")
        if top.value - at.value < LEVEL:
            return Mode(at, Status.CONVERGED)
        higher = _first_rise(case, at, linear, here, top.t)
        if higher is None:
            return Mode(at, Status.CONVERGED if top.value - at.value < ROUGH else Status.STALLED)
        at = higher
    return Mode(at, Status.MAX_ITERATIONS)


def _first_rise(
    case: Case, at: Foothold, linear: Surrogate, here: np.ndarray, there: np.ndarray
) -> Foothold | None:
    """The first of halved steps after which the exact density is higher."""
    for halving in range(HALVINGS):
        point = np.asarray(linear.point(jnp.asarray(here + 0.5**halving * (there - here))))
        rows, slopes, solution = rows_and_slopes(
            case.problem, case.likelihood, jnp.asarray(point[:-2]), at.solution
        )
        value = case.density(rows, point)
        if value > at.value and all(status.ok for status in solution.status()):
            return Foothold(point, rows, slopes, solution, value)
    return None
