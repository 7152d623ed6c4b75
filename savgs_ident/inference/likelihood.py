"""How likely measured harmonics are, given a model that is not perfect.

A harmonic X_k (Re, Im) of a channel in a dwell is taken as normal about the model's H_k, with covariance

    s^2 C_k + (d a_k)^2 I,      a_k = |X_1| / (sqrt(2) k^m),

where C_k is its measured noise covariance, s the noise scale and d the model discrepancy: the relative rms
error of the model's first harmonic. Higher orders err less, with a power m that the plant declares for each channel:
m = 1 for an acceleration, which follows a force that jumps, and m = 2 for a deflection, which lies between following
it and being moved by it.

In the principal axes of C_k every real part is a row of its own, independent of all others: row i is normal about the
model with variance s^2 v_i + (d a_i)^2, where v_i is its noise and a_i what a relative discrepancy of one would do to
it. Errors that many rows share, the background of small errors of :mod:`savgs_ident.inference.background`, are no
diagonal in these axes. In those of noise and background together (:func:`sharing_errors`) rows are independent again,
and all that is said of rows holds for them.

Both scales are estimated, under the priors of :class:`savgs_ident.inference.prior.Scales`: in :class:`Likelihood` as
coordinates of a point that a sampler moves, in :func:`noise_scales` at their best values for given residuals. A model
that misses is thereby weighed by what it can explain.
"""

from dataclasses import replace
from math import exp, isfinite, log, sqrt
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.typing import NDArray

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import NUISANCE, Scales
from savgs_ident.inference.targets import HarmonicTarget


class RowLikelihood(eqx.Module):
    """m independent rows.

    ``measured`` (m,) is what they are, ``variance`` (m,) their noise, ``discrepancy_scale`` (m,) their a_i; in the
    unit of their reading, ``variance`` in its square. ``scales`` says what a point's last two coordinates mean.
    """

    measured: Float[Array, " m"]
    variance: Float[Array, " m"]
    discrepancy_scale: Float[Array, " m"]
    scales: Scales

    def spread(self, point: Float[Array, " n+2"]) -> Float[Array, " m"]:
        """Variance of the rows [unit^2] about the model's, noise and discrepancy together."""
        noise, miss = self.scales.noise_scale(point), self.scales.miss(point)
        return noise**2 * self.variance + (miss * self.discrepancy_scale) ** 2

    def __call__(self, rows: Float[Array, " m"], point: Float[Array, " n+2"]) -> Float[Array, ""]:
        """Log likelihood of the model's ``rows``, up to a constant. Rows are in the unit of their reading."""
        spread = self.spread(point)
        return -0.5 * jnp.sum((rows - self.measured) ** 2 / spread + jnp.log(spread / self.variance))

    @property
    def data(self) -> Data:
        """The measured rows, which count as of one test."""
        return self._data(np.zeros(len(self.measured), np.intp))

    def _data(self, tests: NDArray[np.intp]) -> Data:
        measured, variance, discrepancy_scale = (
            np.asarray(each) for each in (self.measured, self.variance, self.discrepancy_scale)
        )
        return Data(measured, variance, discrepancy_scale, tests, self.scales)


class Likelihood(RowLikelihood):
    """Measured harmonics as m independent rows.

    ``axes`` (D, C, K, 2, 2) turns (Re, Im) of every harmonic into its principal axes, ``place`` (m,) picks
    the rows that are compared; both are without dimension. Where rows share errors, ``turning`` (m, m) makes rows
    without unit of them that do not. ``nuisance`` are directions of the rows that are not turned in which they say
    nothing [units of the rows]; then ``back`` leads from turned rows to those that are not, and what is beside them.
    """

    axes: Float[Array, "D C K 2 2"]
    place: np.ndarray
    turning: Float[Array, "r m"] | None = None
    back: tuple[Float[Array, "m r"], Float[Array, " m"]] | None = None
    nuisance: Float[Array, "m t"] | None = None

    def rows(self, harmonics: Complex[Array, "D C K"]) -> Float[Array, " m"]:
        """Predicted harmonics as rows [units of the channels, or 1 where they are turned], (m,)."""
        parts = jnp.stack([harmonics.real, harmonics.imag], axis=-1)
        rows = jnp.einsum("dckij,dckj->dcki", self.axes, parts).ravel()[self.place]
        return rows if self.turning is None else self.turning @ rows

    def rows_of_one(self, harmonics: NDArray[np.complex128]) -> NDArray[np.float64]:
        """The same of harmonics (D, C, K) outside any program: to dispatch one would take longer."""
        parts = np.stack([harmonics.real, harmonics.imag], axis=-1)
        rows = np.einsum("dckij,dckj->dcki", np.asarray(self.axes), parts).ravel()[self.place]
        return rows if self.turning is None else np.asarray(self.turning) @ rows

    @property
    def test(self) -> NDArray[np.intp]:
        """The test of each row that is not turned, counted from 0, (m,)."""
        return self._part(0)

    @property
    def channel(self) -> NDArray[np.intp]:
        """The channel of each row that is not turned, counted from 0, (m,)."""
        return self._part(1)

    def _part(self, axis: int) -> NDArray[np.intp]:
        return np.unravel_index(self.place, self.axes.shape[:4])[axis]

    @property
    def data(self) -> Data:
        """The measured rows; those that are turned are of all tests and count as of one."""
        if self.turning is not None:
            return super().data
        found = self._data(self.test)
        return found if self.nuisance is None else replace(found, nuisance=np.asarray(self.nuisance))

    def harmonics(
        self, rows: Float[np.ndarray, "S m"], shape: tuple[int, ...]
    ) -> Complex[np.ndarray, "S D C K"]:
        """Rows [unit of the reading] as complex harmonics ``(S, *shape)``; zero where nothing is compared."""
        parts = np.zeros((rows.shape[0], 2 * int(np.prod(shape))))
        parts[:, self.place] = rows if self.turning is None else self._turned_back(rows)
        turned = np.einsum("dckij,sdcki->sdckj", np.asarray(self.axes), parts.reshape(-1, *shape, 2))
        return np.asarray(turned[..., 0] + 1j * turned[..., 1])

    def _turned_back(self, rows: Float[np.ndarray, "S r"]) -> Float[np.ndarray, "S m"]:
        """Rows before they were turned; along nuisances they are as near the measured ones as these make them."""
        if self.back is None:
            return np.asarray(np.linalg.solve(np.asarray(self.turning), rows.T).T)
        matrix, rest = (np.asarray(each) for each in self.back)
        return np.asarray(rows @ matrix.T + rest)


def likelihood_of(target: HarmonicTarget, scales: Scales | None = None) -> Likelihood:
    """The likelihood of the harmonics that a fit compares."""
    used = np.asarray(target.used)
    whitening = np.asarray(target.whitening)
    precision = np.einsum("dckji,dckjl->dckil", whitening, whitening)
    values, vectors = np.linalg.eigh(np.where(used[..., None, None], precision, np.eye(2)))
    axes = np.swapaxes(vectors, -1, -2)
    place = np.flatnonzero(np.repeat(used.ravel(), 2))
    harmonics = np.asarray(target.measured)
    parts = np.stack([harmonics.real, harmonics.imag], axis=-1)
    rows = np.einsum("dckij,dckj->dcki", axes, parts).ravel()[place]
    discrepancy_scale = np.repeat(
        _discrepancy_scales(harmonics, used, target)[..., None], 2, axis=-1
    ).ravel()[place]
    variance = (1.0 / values).ravel()[place]
    return Likelihood(
        axes=jnp.asarray(axes),
        place=place,
        measured=jnp.asarray(rows),
        variance=jnp.asarray(variance),
        discrepancy_scale=jnp.asarray(discrepancy_scale),
        scales=scales or Scales(),
        nuisance=None
        if target.nuisance is None
        else _nuisance_rows(np.asarray(target.nuisance), whitening, axes, place),
    )


def _nuisance_rows(
    nuisance: np.ndarray, whitening: np.ndarray, axes: np.ndarray, place: np.ndarray
) -> Float[Array, "m t"]:
    """Directions of the residuals of a target (all, t) as directions of the rows."""
    unused = np.all(whitening == 0.0, axis=(-2, -1), keepdims=True)
    spread = np.linalg.inv(whitening + unused * np.eye(2))
    parts = nuisance.reshape(*whitening.shape[:-1], -1)
    rows = np.einsum("dckij,dckjl,dcklt->dckit", axes, spread, parts)
    return jnp.asarray(rows.reshape(-1, nuisance.shape[1])[place])


def sharing_errors(likelihood: Likelihood, data: Data) -> Likelihood:
    """The likelihood of the same harmonics where their rows share the errors that ``data`` says, of the same rows."""
    alone = data.independent
    turning, back = data.turned(np.eye(data.measured.size)), None
    if data.nuisance is not None:
        # Numbers count by their noise, or those in small units would be what others make of them.
        sd = np.sqrt(data.variance)
        matrix = sd[:, None] * np.linalg.pinv(turning * sd)
        back = jnp.asarray(matrix), jnp.asarray(data.measured - matrix @ alone.measured)
    return Likelihood(
        axes=likelihood.axes,
        place=likelihood.place,
        measured=jnp.asarray(alone.measured),
        variance=jnp.asarray(alone.variance),
        discrepancy_scale=jnp.asarray(alone.discrepancy_scale),
        scales=data.scales,
        turning=jnp.asarray(turning),
        back=back,
    )


NEAR = 1.0 / 4.0
"""Harmonics of a window to that share of the order to either side say how large a discrepancy of one is there."""


def _discrepancy_scales(harmonics: np.ndarray, used: np.ndarray, target: HarmonicTarget) -> np.ndarray:
    """a_k of every harmonic; the largest compared one stands in for a first one that is not compared."""
    sizes, windows = np.abs(harmonics) * used, list(target.windows)
    first = np.where(used[..., 1], sizes[..., 1], sizes.max(axis=-1))
    order = np.maximum(np.arange(harmonics.shape[-1]), 1)
    power = np.array(target.decay)[:, None]
    found = np.asarray(first[..., None] / (np.sqrt(2.0) * order**power))
    if windows:
        found[windows] = _near_sizes(sizes[windows], used[windows])
    return found


def _near_sizes(sizes: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Root mean square of either part of the harmonics about each order, over all tests, (D, C, K)."""
    squares, count = np.sum(sizes**2, axis=0), np.sum(used, axis=0)
    found = np.zeros(squares.shape)
    for order in range(1, squares.shape[-1]):
        near = slice(max(1, round(order * (1.0 - NEAR))), round(order * (1.0 + NEAR)) + 2)
        found[:, order] = np.sqrt(squares[:, near].sum(axis=-1) / np.maximum(count[:, near].sum(axis=-1), 1))
    return np.broadcast_to(found / np.sqrt(2.0), sizes.shape)


def values_of(
    free: FreeVector, scales: Scales, points: Float[np.ndarray, "*w n+2"]
) -> dict[str, NDArray[np.float64]]:
    """Points as SI values by name, ``(*w,)`` each, the nuisance scales after the parameters."""
    flat = jnp.asarray(points.reshape(-1, points.shape[-1]))
    values = {name: np.asarray(each) for name, each in _constrained(free, flat[:, :-2]).items()}
    values |= dict(
        zip(NUISANCE, (np.asarray(scales.noise_scale(flat)), np.asarray(scales.miss(flat))), strict=True)
    )
    return {name: each.reshape(points.shape[:-1]) for name, each in values.items()}


@eqx.filter_jit
def _constrained(free: FreeVector, us: Array) -> dict[str, Array]:
    return jax.vmap(free.to_constrained)(us)


_ROUNDS = 60
_HALVINGS = 40
_LONGEST = 1.5
_LEVEL = 1e-9


class NoiseScales(NamedTuple):
    """The best noise scale and discrepancy for given residuals.

    Attributes:
        noise: factor on the standard deviation of the noise [1].
        discrepancy: relative rms by which the model misses beyond the noise [1].
        spread: variance of the rows (m,) that they make [unit of the row squared].
        value: log density of the rows in units of their noise, the priors of both scales included.
        converged: whether the search for them ended at a maximum.
    """

    noise: float
    discrepancy: float
    spread: NDArray[np.float64]
    value: float
    converged: bool


def noise_scales(data: Data, residual: NDArray[np.float64]) -> NoiseScales:
    """The best noise scale and discrepancy for residuals (m,) of independent rows."""
    return with_more_discrepancy(data, residual, _maximum_from(data, residual, 1.0, 1e-2))


def noise_scales_near(data: Data, residual: NDArray[np.float64], near: NoiseScales) -> NoiseScales:
    """The maximum that is reached from the scales of similar residuals, which need not be the best."""
    return _maximum_from(data, residual, near.noise, near.discrepancy)


def with_more_discrepancy(data: Data, residual: NDArray[np.float64], found: NoiseScales) -> NoiseScales:
    """What was found, or the maximum with more discrepancy where that is better.

    There may be two maxima, of which one has little discrepancy: where the residuals have room for more than was
    found, it is looked for from there too.
    """
    excess, discrepancy_scale = (
        float(np.sum(residual**2 - data.variance)),
        float(np.sum(data.discrepancy_scale**2)),
    )
    if excess > 2.0 * max(found.discrepancy, 1e-4) ** 2 * discrepancy_scale > 0.0:
        return max(
            found,
            _maximum_from(data, residual, 1.0, float(np.sqrt(excess / discrepancy_scale))),
            key=lambda each: each.value,
        )
    return found


def _maximum_from(data: Data, residual: NDArray[np.float64], noise: float, discrepancy: float) -> NoiseScales:
    """The maximum that is reached from a noise scale and a discrepancy.

    Steps in the logarithm of the noise scale and the square of the discrepancy: the better of Newton's, which is
    short where residuals far exceed the noise, and Fisher's, which is long there, halved until the density rises.
    Without that, Fisher's scoring swings to and fro where the noise is understated.
    """
    rows = _Rows(
        residual**2,
        data.variance,
        data.discrepancy_scale**2,
        float(np.sum(np.log(data.variance))),
        data.scales,
    )
    point = (log(noise), discrepancy**2 if rows.discrepancy_scale.any() else 0.0)
    value, converged = _density(rows, point), False
    for _ in range(_ROUNDS):
        steps, promised = _steps(rows, point)
        if promised < _LEVEL:
            converged = isfinite(value)
            break
        for halving in range(_HALVINGS):
            share = 0.5**halving
            tried = [
                (point[0] + share * along, max(point[1] + share * square, 0.0)) for along, square in steps
            ]
            found, there = max((_density(rows, each), each) for each in tried)
            if found > value:
                break
        else:
            # What is promised is less than a sum over the rows resolves.
            converged = promised < 1e-6
            break
        point, value = there, found
    scale, miss = exp(point[0]), sqrt(point[1])
    return NoiseScales(
        scale, miss, scale**2 * rows.noise + miss**2 * rows.discrepancy_scale, value, converged
    )


class _Rows(NamedTuple):
    """Squares (m,) of residuals, of the noise's deviations and of what a relative discrepancy of one does.

    And the sum of the logarithms of the noise's, and the priors.
    """

    residual: NDArray[np.float64]
    noise: NDArray[np.float64]
    discrepancy_scale: NDArray[np.float64]
    log_noise: float
    scales: Scales

    def spread(self, point: "_Point") -> NDArray[np.float64]:
        """The variance (m,) at a point."""
        found: NDArray[np.float64] = exp(2.0 * point[0]) * self.noise + point[1] * self.discrepancy_scale
        return found


_Point = tuple[float, float]
"""Logarithm of the noise scale, square of the discrepancy."""


def _steps(rows: _Rows, point: _Point) -> tuple[list[_Point], float]:
    """Newton's step, where the density is concave, and Fisher's; and the rise that they promise at most."""
    trust, width, miss = rows.scales.noise_trust, rows.scales.discrepancy, point[1]
    per_spread = 1.0 / rows.spread(point)
    relative = rows.residual * per_spread - 1.0
    by = rows.discrepancy_scale * per_spread
    curved = by * (relative + 0.5)
    # Of the logarithm of the variance, the derivative by the discrepancy is ``by``, that by the noise scale is
    # 2 (1 - miss by): noise and discrepancy are all of the variance. So every sum over the rows is made of a few.
    m, all_relative, all_by = relative.size, float(relative.sum()), float(by.sum())
    by_relative, by_by, by_curved = float(by @ relative), float(by @ by), float(by @ curved)
    noise_slope = all_relative - miss * by_relative
    gradient = noise_slope - point[0] / trust**2, 0.5 * by_relative - 0.5 / width**2
    all_curved, once_curved = all_relative + 0.5 * m, float(curved.sum())
    fisher = 2.0 * (m - 2.0 * miss * all_by + miss**2 * by_by), all_by - miss * by_by, 0.5 * by_by
    newton = (
        4.0 * (all_curved - 2.0 * miss * once_curved + miss**2 * by_curved) - 2.0 * noise_slope,
        2.0 * (once_curved - miss * by_curved),
        by_curved,
    )
    # No discrepancy is the least one: there it is held.
    held = point[1] == 0.0 and gradient[1] <= 0.0
    found, promised = [], 0.0
    for curvature, both, other in (newton, fisher):
        own = curvature + 1.0 / trust**2
        determinant = own * other - both**2
        if held and own > 0.0:
            along, square = gradient[0] / own, 0.0
        elif own > 0.0 and determinant > 1e-12 * own * abs(other):
            along = (other * gradient[0] - both * gradient[1]) / determinant
            square = (own * gradient[1] - both * gradient[0]) / determinant
        else:
            continue
        promised = max(promised, 0.5 * (gradient[0] * along + gradient[1] * square))
        short = min(1.0, _LONGEST / max(abs(along), _LONGEST))
        found.append((short * along, short * square))
    return found, promised


def _density(rows: _Rows, point: _Point) -> float:
    spread, scales = rows.spread(point), rows.scales
    data = float(rows.residual @ (1.0 / spread)) + float(np.log(spread).sum()) - rows.log_noise
    return -0.5 * (data + (point[0] / scales.noise_trust) ** 2 + point[1] / scales.discrepancy**2)
