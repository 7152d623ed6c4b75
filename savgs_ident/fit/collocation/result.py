"""What the cross-check found, with what the samples tell about it."""

from collections.abc import Mapping
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.fit.collocation.program import Program
from savgs_ident.fit.collocation.solve import Solution
from savgs_ident.fit.collocation.spread import spread_at
from savgs_ident.fit.covariance import UNTOLD, Spread
from savgs_ident.fit.result import Estimate
from savgs_ident.fit.task import Task


@dataclass(frozen=True)
class CollocationFit:
    """What the cross-check found; arrays are read-only.

    Attributes:
        estimates: all estimated parameters, free ones first.
        covariance: of the estimates in their order [products of their units], (n, n).
        chi2: weighted sum of squared residuals of the samples.
        dof: samples less free parameters and zeros of sensors.
        prior_chi2: squared deviations of the tolerance parameters in their standard deviations.
        status: how IPOPT ended.
        iterations: how many it took.
        tests: names of the dwells.
        unknowns: variables of the optimisation.
        wall_s: time taken [s].
    """

    estimates: tuple[Estimate, ...]
    covariance: NDArray[np.float64]
    chi2: float
    dof: int
    prior_chi2: float
    status: Status
    iterations: int
    tests: tuple[str, ...]
    unknowns: int
    wall_s: float

    def __post_init__(self) -> None:
        self.covariance.flags.writeable = False

    @property
    def by_name(self) -> Mapping[str, Estimate]:
        """The estimates by parameter name."""
        return {estimate.name: estimate for estimate in self.estimates}


def assemble_result(task: Task, program: Program, end: Solution, wall_s: float) -> CollocationFit:
    """The whole, frozen result; without a solution there is no covariance."""
    problem, n = task.problem, program.unknowns.parameters
    u = jnp.asarray(end.w[:n])
    spread = spread_at(program, end.w) if end.status.ok else Spread(np.full((n, n), np.nan))
    slope = np.asarray(problem.slopes(u))
    prior = float(np.sum(np.asarray(problem.free.prior_residuals(u)) ** 2))
    told = len(problem.free.identified) + program.unknowns.zeros.size
    return CollocationFit(
        estimates=_estimates(task, u, slope * _told(spread)),
        covariance=np.asarray(spread.covariance * np.outer(slope, slope), np.float64),
        chi2=2.0 * end.objective - prior,
        dof=program.quadratic.samples - told,
        prior_chi2=prior,
        status=end.status,
        iterations=end.iterations,
        tests=task.measured.tests,
        unknowns=program.unknowns.size,
        wall_s=wall_s,
    )


def _told(spread: Spread) -> NDArray[np.float64]:
    """Standard deviations, infinite where there is nothing to tell."""
    return np.where(spread.sd >= 0.1 * UNTOLD, np.inf, spread.sd)


def _estimates(task: Task, u: Array, stderr: NDArray[np.float64]) -> tuple[Estimate, ...]:
    free, values = task.problem.free, task.problem.parameters(u)
    estimates = []
    for name, sd in zip(free.names, stderr, strict=True):
        known = task.table[name]
        identified = name in free.identified
        estimates.append(
            Estimate(
                name, float(values[name]), float(sd), known.unit, identified, known.value, known.tolerance
            )
        )
    return tuple(estimates)
