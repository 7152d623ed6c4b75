"""The toy's posterior by brute force: importance sampling with its density written out once more."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_t, norm

from .toy import Toy

DRAWS = 200_000


class Reference(NamedTuple):
    """Weighted points (k, n + 2), the last coordinate positive; ``weight`` sums to one."""

    points: NDArray[np.float64]
    weight: NDArray[np.float64]

    @property
    def ess(self) -> float:
        """Independent draws that the points are worth."""
        return float(1.0 / np.sum(self.weight**2))

    def quantile(self, place: int, share: float) -> float:
        """A quantile of one coordinate."""
        order = np.argsort(self.points[:, place])
        mass = np.cumsum(self.weight[order])
        return float(np.interp(share, mass, self.points[order, place]))

    def sd(self, place: int) -> float:
        """The standard deviation of one coordinate."""
        values = self.points[:, place]
        mean = self.weight @ values
        return float(np.sqrt(self.weight @ (values - mean) ** 2))


def log_density(toy: Toy, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log density of points (k, 5) from the definitions, up to a constant."""
    likelihood = toy.likelihood
    rows, solved = toy.rows(points[:, :-2])
    variance, reach = np.asarray(likelihood.variance), np.asarray(likelihood.discrepancy_scale)
    noise, miss = np.exp(0.1 * points[:, -2:-1]), 0.05 * points[:, -1:]
    deviation = np.sqrt(noise**2 * variance + (miss * reach) ** 2)
    data = norm.logpdf(np.asarray(likelihood.measured), rows, deviation).sum(axis=1)
    # Three e-folds for what has no tolerance, one standard deviation for all else.
    known = norm.logpdf(points, scale=[3.0, 3.0, 1.0, 1.0, 1.0]).sum(axis=1)
    return np.where(solved, data + known, -np.inf)


def reference_of(toy: Toy, mode: NDArray[np.float64]) -> Reference:
    """Draws from a wide t distribution about ``mode``, weighted."""
    step = 1e-3
    eye = np.eye(mode.size)

    def at(*shifts: NDArray[np.float64]) -> float:
        return float(log_density(toy, (mode + step * sum(shifts))[None])[0])

    curvature = np.array([[at(i, j) - at(i, -j) - at(-i, j) + at(-i, -j) for j in eye] for i in eye]) / (
        4.0 * step**2
    )
    proposal = multivariate_t(mode, 1.3 * np.linalg.inv(-curvature), df=6, seed=7)
    points = proposal.rvs(DRAWS)
    inside = points[:, -1] > 0.0
    points = points[inside]
    logs = log_density(toy, points) - proposal.logpdf(points)
    weight = np.exp(logs - logs.max())
    return Reference(points, weight / weight.sum())
