"""The model near its posterior's mode: exactly, and as a cheap stand-in to second order.

The exact model (:class:`ExactModel`) decides about every proposal of a sampler, the surrogate proposes. With v one
standard deviation along the principal axes of :class:`savgs_ident.inference.straightened.Straightened` coordinates,
y = scale v, the rows of the likelihood are

    rows(v) = rows + slope v + 1/2 sum_ij v_i v_j bend_ij.

The slopes are exact, the second derivatives their differences one standard deviation away; of these only the
leading shapes of a singular value decomposition are kept. Along each axis that bends by itself the rows are exact
further out, too: what the sum above leaves there is added, between points where the model was solved (see
:class:`Curve`).
A contact that is known to an order of magnitude does little beyond some stiffness, and no polynomial follows that.

Where data identify a product of two parameters far better than either of them, the posterior is a thin banana,
along which neither random steps nor trajectories get on. A triangular map straightens it:

    v_k = t_k - sum over i, j > k of share_ijk t_i t_j,

axes sorted from the best identified to the least. It makes up for most of the bend B(v, v) / 2 by a change of the
well identified coordinates, so that the rows are nearly linear in t and the posterior is nearly a unit normal. As
v_k depends on t_k and later ones only, volumes stay as they are and the way back is one substitution after the
other.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.status import Status
from savgs_ident.inference.likelihood import RowLikelihood
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import NUISANCE, Prior
from savgs_ident.inference.straightened import Straightened


class LinearRows(NamedTuple):
    """A model at a point: rows (m,), their slopes (m, n) in u, what it is solved from nearby, and how that ended."""

    rows: Float[np.ndarray, " m"]
    slopes: Float[np.ndarray, "m n"]
    warm_start: Any
    status: Status


class LinearisationPoint(NamedTuple):
    """A model about a point of its posterior: rows (m,), their slopes (m, n) in u, and the exact log density.

    ``warm_start`` is what the model is solved from nearby.
    """

    point: Float[np.ndarray, " n+2"]
    rows: Float[np.ndarray, " m"]
    slopes: Float[np.ndarray, "m n"]
    warm_start: Any
    value: float


class ExactModel(Protocol):
    """A model about a point where it is known."""

    @property
    def likelihood(self) -> RowLikelihood:
        """Of its rows."""

    def rows(self, us: Float[np.ndarray, "W n"]) -> tuple[Float[np.ndarray, "W m"], np.ndarray]:
        """Rows of the likelihood at several sets of free coordinates, (W, m), and whether they were solved, (W,)."""

    def predicted(self, u: Float[Array, " n"]) -> Any:
        """What the model is solved from at free coordinates ``u``, better than from the point; None if nothing is."""


class SampledProblem(Protocol):
    """What a posterior asks of a model that is held against data. ``u`` are free coordinates."""

    @property
    def free(self) -> FreeVector:
        """The parameters that are sampled."""

    def linear_rows(
        self, likelihood: Any, u: Float[Array, " n"], warm_start: Any, predicted: Any = None
    ) -> LinearRows:
        """The model at ``u``, solved as near ``warm_start``, from ``predicted`` where that is given."""

    def refined(self, u: Float[Array, " n"], warm_start: Any) -> Any:
        """What the model is solved from near ``u``, made as precise as it can be."""

    def with_background(
        self, likelihood: Any, at: LinearisationPoint, drifting: Sequence[str]
    ) -> tuple["SampledProblem", Any, Data]:
        """The same, and its likelihood, with the small errors that any model has, and the data that say which.

        ``drifting`` are free parameters that may change while the recordings are made.
        """

    def exact(self, likelihood: Any, u: Float[Array, " n"], warm_start: Any) -> ExactModel:
        """The model about ``u``, where it is known."""


class TriangularMap(eqx.Module):
    """The map from t (n,) to v (n,): products t_first t_second (q,) times ``share`` (q, n)."""

    first: np.ndarray
    second: np.ndarray
    share: Float[Array, "q n"]

    def __call__(self, t: Float[Array, " n"]) -> Float[Array, " n"]:
        """The v of round coordinates t, both in standard deviations."""
        return t - (t[self.first] * t[self.second]) @ self.share

    def inverse(self, v: Float[np.ndarray, "w n"]) -> Float[np.ndarray, "w n"]:
        """The round coordinates of several v, both in standard deviations."""
        t, share = np.array(v), np.asarray(self.share)
        for axis in reversed(range(t.shape[1])):
            t[:, axis] = v[:, axis] + (t[:, self.first] * t[:, self.second]) @ share[:, axis]
        return t


def identity_map(size: int) -> TriangularMap:
    """The map that leaves v = t."""
    nothing = np.zeros(0, dtype=int)
    return TriangularMap(nothing, nothing, jnp.zeros((0, size)))


def triangular_map_of(
    second: Float[np.ndarray, "n n m"], slope: Float[np.ndarray, "m n"], weight: Float[np.ndarray, " m"]
) -> TriangularMap:
    """The map that makes up for ``second`` derivatives in v of rows with ``slope`` in v.

    ``weight`` (m,) is one over the rows' deviations; columns of slope and prior together are orthonormal. v
    is in standard deviations.
    """
    count = second.shape[0]
    first, other = np.triu_indices(count)
    symmetric = 0.5 * (second + np.swapaxes(second, 0, 1))[first, other]
    pairs = symmetric * np.where(first == other, 0.5, 1.0)[:, None]
    share = (pairs * weight**2) @ slope
    later = np.minimum(first, other)[:, None] > np.arange(count)
    return TriangularMap(first, other, jnp.asarray(share * later))


SHAPES = 48
"""Most shapes that are kept. Their number does not depend on the data, so that programs serve for all."""


class Bend(NamedTuple):
    """Second derivatives: products v_first v_second (q,) times ``share`` (q, k) times ``shape`` (k, m)."""

    first: np.ndarray
    second: np.ndarray
    share: Float[Array, "q k"]
    shape: Float[Array, "k m"]


SPACING = 2.0
"""Standard deviations from one point to the next at which rows along an axis are exact."""

PLACES = np.array([-3, -2, -1, 1, 2, 3]) * SPACING
"""These points. Origin: by choice; further out there are no draws."""


class Curve(NamedTuple):
    """What rows are along single axes beyond second order: v^2 times a curve through its values at the places.

    Their ``share`` (n, 7, k), zero in the middle, times ``shape`` (k, m). Further out the outermost value holds.
    """

    share: Float[Array, "n 7 k"]
    shape: Float[Array, "k m"]

    def at(self, v: Float[Array, " n"]) -> Float[Array, " m"]:
        """What it adds to the rows at ``v``."""
        weights = jax.vmap(_weights)(v) * (v**2)[:, None]
        return jnp.einsum("ip,ipk->k", weights, self.share) @ self.shape


def _weights(v: Array) -> Array:
    """Of the values at seven places, (7,), in a curve through them at v: cubic convolution, flat beyond its ends."""
    last = PLACES[-1] / SPACING
    # Beyond the outermost place stands its value again.
    places = jnp.arange(-last - 1.0, last + 2.0)
    off = jnp.abs(jnp.clip(v / SPACING, -last, last) - places)
    near, far = (1.5 * off - 2.5) * off**2 + 1.0, ((-0.5 * off + 2.5) * off - 4.0) * off + 2.0
    weights = jnp.where(off < 1.0, near, jnp.where(off < 2.0, far, 0.0))
    return weights[1:-1].at[jnp.array([0, -1])].add(weights[jnp.array([0, -1])])


class Surrogate(eqx.Module):
    """Log density over t (n + 2,); ``rows`` (m,) and ``slope`` (m, n) are the model's at v = 0.

    t is in standard deviations, rows are in the unit of their reading. Axes ``scale`` are those of ``straightened``
    coordinates. The map takes ``middle`` + ``width`` t, both (n + 2,) [1]: where the density lies and how wide it is,
    which its curvature in one point does not say.
    """

    likelihood: RowLikelihood
    prior: Prior
    straightened: Straightened
    scale: Float[Array, "n+2 n+2"]
    rows: Float[Array, " m"]
    slope: Float[Array, "m n"]
    bend: Bend
    curve: Curve
    map: TriangularMap
    middle: Float[Array, " n+2"]
    width: Float[Array, " n+2"]

    @property
    def centre(self) -> Float[Array, " n+2"]:
        """The point of the posterior [free coordinates, 1] that it was made about."""
        return self.straightened.centre

    def point(self, t: Float[Array, " n+2"]) -> Float[Array, " n+2"]:
        """The point of the posterior [free coordinates, 1] at ``t`` in standard deviations."""
        return self.straightened.points(self.scale @ self._mapped(t))

    def log_volume(self, t: Float[Array, " n+2"]) -> Float[Array, ""]:
        """Logarithm of the volume of points to that of ``t``, but for a constant."""
        return jnp.sum(jnp.log(self.straightened.slopes(self.scale @ self._mapped(t))))

    def predicted(self, t: Float[Array, " n+2"]) -> Float[Array, " m"]:
        """The rows of the likelihood [unit of the reading] at ``t``."""
        return self.rows_at(self._mapped(t)[: -len(NUISANCE)])

    def rows_at(self, v: Float[Array, " n"]) -> Float[Array, " m"]:
        """The rows of the likelihood [unit of the reading] at ``v`` in standard deviations."""
        products = v[self.bend.first] * v[self.bend.second]
        second_order = self.rows + self.slope @ v + (products @ self.bend.share) @ self.bend.shape
        return second_order + self.curve.at(v)

    def of_point(self, t: Float[Array, " n+2"]) -> Float[Array, ""]:
        """The log density of points at that of ``t``, up to a constant."""
        point = self.point(t)
        return self.likelihood(self.predicted(t), point) + self.prior(point)

    def __call__(self, t: Float[Array, " n+2"]) -> Float[Array, ""]:
        """The log density over t, up to a constant."""
        return self.of_point(t) + self.log_volume(t)

    def log_volumes(self, ts: Float[np.ndarray, "w n+2"]) -> Float[np.ndarray, " w"]:
        """:meth:`log_volume` at several t."""
        return np.asarray(_log_volumes(self, jnp.asarray(ts)))

    def points(self, ts: Float[np.ndarray, "*w n+2"]) -> Float[np.ndarray, "*w n+2"]:
        """The points at several t, which are in standard deviations."""
        flat = jnp.asarray(ts).reshape(-1, self.centre.size)
        return np.asarray(_points(self, flat)).reshape(ts.shape)

    def coordinates(self, points: Float[np.ndarray, "w n+2"]) -> Float[np.ndarray, "w n+2"]:
        """The t of several points, in standard deviations."""
        y = _coordinates(self.straightened, jnp.asarray(points))
        v = np.linalg.solve(np.asarray(self.scale), np.asarray(y).T).T
        split = v.shape[1] - len(NUISANCE)
        t = np.concatenate([self.map.inverse(v[:, :split]), v[:, split:]], axis=1)
        return np.asarray((t - np.asarray(self.middle)) / np.asarray(self.width))

    def with_draws(self, ts: Float[np.ndarray, "w n+2"]) -> "Surrogate":
        """The same with a t that is about zero and one wide in draws of it."""
        middle = self.middle + self.width * jnp.asarray(ts.mean(axis=0))
        width = self.width * jnp.asarray(ts.std(axis=0))
        found: Surrogate = eqx.tree_at(lambda each: (each.middle, each.width), self, (middle, width))
        return found

    def _mapped(self, t: Array) -> Array:
        split, wide = t.size - len(NUISANCE), self.middle + self.width * t
        return jnp.concatenate([self.map(wide[:split]), wide[split:]])


@eqx.filter_jit
def _points(surrogate: Surrogate, ts: Array) -> Array:
    return jax.vmap(surrogate.point)(ts)


@eqx.filter_jit
def _coordinates(straightened: Straightened, points: Array) -> Array:
    return jax.vmap(straightened.coordinates)(points)


@eqx.filter_jit
def _log_volumes(surrogate: Surrogate, ts: Array) -> Array:
    return jax.vmap(surrogate.log_volume)(ts)


def no_bend(rows: int) -> Bend:
    """Second derivatives of a linear surrogate."""
    nothing = np.zeros(0, dtype=int)
    return Bend(nothing, nothing, jnp.zeros((0, 0)), jnp.zeros((0, rows)))


def no_curve(axes: int, rows: int) -> Curve:
    """Nothing beyond second order."""
    return Curve(jnp.zeros((axes, PLACES.size + 1, 0)), jnp.zeros((0, rows)))


def curve_of(left: Float[np.ndarray, "n 6 m"], weight: Float[np.ndarray, " m"]) -> Curve:
    """The curve of what second order leaves of rows at the places along each axis.

    ``weight`` (m,) is one over the rows' deviations.
    """
    values = (left / PLACES[:, None] ** 2 * weight).reshape(-1, weight.size)
    over, sizes, shape = np.linalg.svd(values, full_matrices=False)
    share = (over[:, :SHAPES] * sizes[:SHAPES]).reshape(*left.shape[:2], -1)
    return Curve(
        jnp.asarray(np.insert(share, PLACES.size // 2, 0.0, axis=1)), jnp.asarray(shape[:SHAPES] / weight)
    )


def bend_of(second: Float[np.ndarray, "n n m"], weight: Float[np.ndarray, " m"]) -> Bend:
    """The bend of second derivatives in v, symmetrised; ``weight`` (m,) is one over the rows' deviations.

    v is in standard deviations.
    """
    symmetric = 0.5 * (second + np.swapaxes(second, 0, 1))
    first, other = np.triu_indices(symmetric.shape[0])
    pairs = symmetric[first, other] * np.where(first == other, 0.5, 1.0)[:, None] * weight
    left, sizes, right = np.linalg.svd(pairs, full_matrices=False)
    share = left[:, :SHAPES] * sizes[:SHAPES]
    return Bend(first, other, jnp.asarray(share), jnp.asarray(right[:SHAPES] / weight))
