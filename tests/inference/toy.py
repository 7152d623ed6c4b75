"""A model whose rows are a known polynomial of its parameters: the posterior without the quarter car.

It has what the posterior asks of a model: ``rows`` and ``responses`` at several parameter sets, ``likelihood``
and ``problem`` with its free vector and target.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.inference.harmonic_model import Responses
from savgs_ident.inference.likelihood import Likelihood, likelihood_of
from savgs_ident.inference.prior import Scales
from savgs_ident.inference.targets import HarmonicTarget, harmonic_target
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.responses.harmonic_response import HarmonicResponse

CHANNELS = ("road_height", "sprung_accel", "susp_deflection")

PARAMETERS = ParameterTable(
    (
        Parameter("friction", 0.03, "1", lower=0.0, upper=0.5, about="of the rail"),
        Parameter("damping", 5800.0, "N s/m", lower=0.0),
        Parameter("spring", 157e3, "N/m", tolerance=1.6e3, lower=0.0),
    )
)
"""One of every common kind: between bounds, above one bound, known to a tolerance."""

FREE = FreeVector(PARAMETERS, ("friction", "damping"), ("spring",))

FIXED_SCALES = Scales(noise_trust=1e-6, discrepancy=1e-9)
"""Scales that are as good as known: noise as measured, no discrepancy. The rest of the posterior is normal."""


class ToyProblem(NamedTuple):
    """What the posterior reads of a problem."""

    free: FreeVector
    target: HarmonicTarget


@dataclass(frozen=True)
class Toy:
    """Rows base + slope u + bend(u, u) / 2 + cubic u_0^3; no solution where u_0 is above ``edge``."""

    problem: ToyProblem
    likelihood: Likelihood
    measured: HarmonicResponse
    base: NDArray[np.float64]
    slope: NDArray[np.float64]
    bend: NDArray[np.float64]
    cubic: NDArray[np.float64]
    edge: float = np.inf

    def rows(self, us: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Rows (W, m) at parameters (W, n), and whether they are solved; NaN where they are not."""
        second = 0.5 * np.einsum("wi,wj,ijm->wm", us, us, self.bend, optimize=True)
        rows = self.base + us @ self.slope.T + second + us[:, :1] ** 3 * self.cubic
        solved = us[:, 0] <= self.edge
        return np.where(solved[:, None], rows, np.nan), solved

    def slopes(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """d rows / du at ``u``, (m, n)."""
        slopes = self.slope + np.einsum("j,ijm->mi", u, self.bend)
        slopes[:, 0] += 3.0 * u[0] ** 2 * self.cubic
        return slopes

    def responses(self, us: NDArray[np.float64]) -> Responses:
        """The rows as harmonics."""
        rows, solved = self.rows(us)
        shape = np.shape(self.problem.target.used)
        safe = np.where(solved[:, None], rows, 0.0)
        return Responses(self.likelihood.harmonics(safe, shape), solved)


def covariances(random: np.random.Generator, shape: tuple[int, ...], sd: float) -> NDArray[np.float64]:
    """Correlated covariances of (Re, Im), of about ``sd``^2."""
    factor = sd * (np.eye(2) + 0.5 * random.standard_normal((*shape, 2, 2)))
    return np.asarray(factor @ np.swapaxes(factor, -1, -2) + 0.05 * sd**2 * np.eye(2))


def campaign(
    random: np.random.Generator, harmonics: NDArray[np.complex128], covariance: NDArray[np.float64]
) -> HarmonicResponse:
    """A noisy measurement of harmonics (D, 2, K) of the response channels."""
    dwells, _, orders = harmonics.shape
    noise = np.linalg.cholesky(covariance) @ random.standard_normal((*harmonics.shape, 2, 1))
    seen = np.zeros((dwells, len(CHANNELS), orders), dtype=complex)
    seen[:, 1:] = harmonics + noise[..., 0, 0] + 1j * noise[..., 1, 0]
    spread = np.tile(np.eye(2), (dwells, len(CHANNELS), orders, 1, 1))
    spread[:, 1:] = covariance
    by_channel = np.ones((dwells, len(CHANNELS)))
    return HarmonicResponse(
        tests=tuple(f"dwell {place}" for place in range(dwells)),
        channels=CHANNELS,
        frequency=1.0 + np.arange(dwells),
        frequency_sd=np.full(dwells, 1e-5),
        harmonics=seen,
        covariance=spread,
        valid=np.ones(seen.shape, dtype=bool),
        peak_to_peak=by_channel,
        peak_to_peak_sd=by_channel,
        noise_sd=by_channel,
        periods=np.full(dwells, 30),
    )


def straight_toy(
    free: FreeVector = FREE,
    scales: Scales | None = None,
    strength: float = 5.0,
    miss: float = 0.0,
    dwells: int = 3,
    seed: int = 2,
) -> Toy:
    """A model that is linear in u; ``strength`` is the change of a row with u in deviations of its noise.

    Data are made at u = 0, with the model ``miss`` off, in the sense of the discrepancy.
    """
    random = np.random.default_rng(seed)
    orders = 3
    sizes = 1.0 / np.maximum(np.arange(orders), 1.0) ** np.array([[1], [2]])
    harmonics = sizes * np.exp(1j * random.uniform(0.0, 2.0 * np.pi, (dwells, 2, orders)))
    off = random.standard_normal(harmonics.shape) + 1j * random.standard_normal(harmonics.shape)
    covariance = covariances(random, harmonics.shape, 0.01)
    measured = campaign(random, harmonics + miss * sizes / np.sqrt(2.0) * off, covariance)
    target = harmonic_target(measured, QuarterCar.channels, orders - 1)
    likelihood = likelihood_of(target, scales)
    deviation = np.sqrt(np.asarray(likelihood.variance))
    count = len(free.names)
    slope = strength * deviation[:, None] * random.standard_normal((deviation.size, count))
    return Toy(
        problem=ToyProblem(free, target),
        likelihood=likelihood,
        measured=measured,
        base=np.asarray(likelihood.rows(jnp.asarray(harmonics))),
        slope=slope,
        bend=np.zeros((count, count, deviation.size)),
        cubic=np.zeros(deviation.size),
    )


def bent_toy(seed: int = 2) -> Toy:
    """A model that also bends: within two deviations of the posterior by as much as the noise."""
    toy = straight_toy(strength=2.0, miss=0.02, seed=seed)
    random = np.random.default_rng(seed + 1)
    deviation = np.sqrt(np.asarray(toy.likelihood.variance))
    bend = 8.0 * deviation * random.standard_normal((*toy.bend.shape[:2], deviation.size))
    cubic = 8.0 * deviation * random.standard_normal(deviation.size)
    return replace(toy, bend=0.5 * (bend + np.swapaxes(bend, 0, 1)), cubic=cubic)
