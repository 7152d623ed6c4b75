"""What is known of parameters before the data.

Every parameter has a coordinate x of which the prior is the unit normal:

- one of the plant's sheet (:class:`Sheet`) has the transform and the width of :mod:`savgs_ident.core.transforms`, the
  same in a fit, a posterior and a diagnosis;
- the amplitude of an effect (:class:`Linear`) begins at its null, and may be held at a bound;
- what shapes an effect (:class:`Logarithmic`) is log-normal about its typical value.

A point of the posterior is (u, a, b): the unconstrained coordinates u = width x of the parameters, and a, b of the
likelihood's scales (:mod:`savgs_ident.inference.likelihood`).
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import exp, inf, log
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray
from scipy.special import ndtri

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import Parameter
from savgs_ident.core.transforms import AbstractBijection, Tolerated, move_inside, prior_width, transform_of


@dataclass(frozen=True)
class AbstractCoordinate:
    """One parameter on a coordinate x of which the prior is the unit normal.

    Attributes:
        name: name of the parameter.
        unit: its unit, SI.
    """

    name: str
    unit: str

    @abstractmethod
    def value(self, x: float) -> float:
        """The parameter [unit] at a coordinate."""

    @abstractmethod
    def slope(self, x: float) -> float:
        """d value / dx [unit]."""

    @abstractmethod
    def at(self, value: float) -> float:
        """The coordinate [1] of a value [unit]."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """The coordinates of the bounds [1]."""

    @cached_property
    def halved(self) -> bool:
        """Whether the prior begins at its own centre."""
        return 0.0 in self.bounds


@dataclass(frozen=True)
class Sheet(AbstractCoordinate):
    """A parameter of the plant's sheet, with the transform and the prior that it has everywhere.

    Its bounds are never reached, see :mod:`savgs_ident.core.transforms`.

    Attributes:
        parameter: value, tolerance and bounds.
    """

    parameter: Parameter

    @property
    def known(self) -> bool:
        """Whether it is known to a tolerance."""
        return isinstance(self._transform, Tolerated)

    @property
    def bounds(self) -> tuple[float, float]:
        """None."""
        return -inf, inf

    def value(self, x: float) -> float:
        """The parameter [unit] at a coordinate."""
        return float(self._transform.forward(self._width * x))

    def slope(self, x: float) -> float:
        """d value / dx [unit]."""
        return self._width * self._transform.slope(self._width * x)

    def at(self, value: float) -> float:
        """The coordinate of a value [unit]; raises :class:`InputError` outside the parameter's bounds."""
        return float(self._transform.inverse(move_inside(self.parameter, value))) / self._width

    @cached_property
    def _transform(self) -> AbstractBijection:
        return transform_of(self.parameter)

    @cached_property
    def _width(self) -> float:
        return prior_width(self.parameter)


@dataclass(frozen=True)
class AbstractEffectCoordinate(AbstractCoordinate):
    """A parameter of an effect, within bounds that it may reach.

    Attributes:
        centre: the value at x = 0 [unit].
        scale: one standard deviation of the prior [unit, or 1 for a logarithmic coordinate].
        lower: smallest value [unit].
        upper: largest value [unit].
    """

    centre: float
    scale: float
    lower: float = -inf
    upper: float = inf

    @property
    def bounds(self) -> tuple[float, float]:
        """The coordinates of the bounds [1]."""
        return self.at(self.lower), self.at(self.upper)


@dataclass(frozen=True)
class Linear(AbstractEffectCoordinate):
    """The amplitude of an effect, value = centre + scale x; a bound that it begins at cuts its prior in half."""

    def value(self, x: float) -> float:
        """The parameter [unit] at a coordinate."""
        return min(max(self.centre + self.scale * x, self.lower), self.upper)

    def slope(self, x: float) -> float:
        """d value / dx [unit]."""
        return self.scale

    def at(self, value: float) -> float:
        """The coordinate of a value."""
        return (value - self.centre) / self.scale


@dataclass(frozen=True)
class Logarithmic(AbstractEffectCoordinate):
    """What shapes an effect and is positive by nature, value = centre exp(scale x)."""

    def value(self, x: float) -> float:
        """The parameter [unit] at a coordinate."""
        return min(max(self.centre * exp(self.scale * x), self.lower), self.upper)

    def slope(self, x: float) -> float:
        """d value / dx [unit]."""
        return self.scale * self.value(x)

    def at(self, value: float) -> float:
        """The coordinate of a value; far below any for zero."""
        return log(value / self.centre) / self.scale if value > 0.0 else -inf


Coordinates = tuple[AbstractCoordinate, ...]
EffectCoordinates = tuple[AbstractEffectCoordinate, ...]


def values_at(coordinates: Coordinates, x: NDArray[np.float64]) -> dict[str, float]:
    """The parameters at coordinates (n,), by name, SI."""
    return {each.name: each.value(float(at)) for each, at in zip(coordinates, x, strict=True)}


def slopes_at(coordinates: Coordinates, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """d value / dx of every parameter [its unit], (n,)."""
    return np.array([each.slope(float(at)) for each, at in zip(coordinates, x, strict=True)])


def bounds_of(coordinates: Sequence[AbstractCoordinate]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper bounds of the coordinates [1], (n,) each."""
    bounds = np.array([each.bounds for each in coordinates]).reshape(-1, 2)
    return bounds[:, 0], bounds[:, 1]


def sheet_coordinate(parameter: Parameter) -> Sheet:
    """The coordinate of a parameter of the plant; raises :class:`InputError` if nothing gives its scale."""
    prior_width(parameter)
    return Sheet(parameter.name, parameter.unit, parameter)


NUISANCE = ("noise_scale", "discrepancy")
"""The scales of the likelihood, in the order of their coordinates a and b."""


class Scales(NamedTuple):
    """Priors of the likelihood's scales: noise scale s = exp(noise_trust a), discrepancy d = discrepancy |b|.

    They are the same in a posterior and in a diagnosis.
    """

    noise_trust: float = 0.1
    """Standard deviation of the logarithm of the noise scale [1].

    The noise covariance was estimated from what does not repeat from period to period. Origin: by choice. A standard
    deviation estimated from n numbers is known to 1 / sqrt(2 n): to 0.1 from 50 of them.
    """

    discrepancy: float = 0.05
    """Scale of the half-normal prior of the model's discrepancy, relative to the response [1].

    Origin: by choice: a model that misses a tenth of the response, two of these, is the wrong model.
    """

    def noise_scale(self, points: Float[Array, "*w n+2"]) -> Float[Array, "*w"]:
        """Factor on the measured noise's standard deviation [1]."""
        return jnp.exp(self.noise_trust * points[..., -2])

    def miss(self, points: Float[Array, "*w n+2"]) -> Float[Array, "*w"]:
        """Relative rms by which the model misses, beyond the noise [1]."""
        return self.discrepancy * jnp.abs(points[..., -1])

    def coordinates(self, noise_scale: float, miss: float) -> Float[np.ndarray, "2"]:
        """The coordinates a and b of a noise scale and a discrepancy [1], b not negative."""
        return np.array([log(noise_scale) / self.noise_trust, miss / self.discrepancy])


class Prior(eqx.Module):
    """Log prior density of points (n + 2,) of the posterior, up to a constant: free coordinates u, then a and b."""

    free: FreeVector

    def __call__(self, point: Float[Array, " n+2"]) -> Float[Array, ""]:
        """The log density."""
        return -0.5 * jnp.sum(self.free.prior_residuals(point[:-2]) ** 2) - 0.5 * jnp.sum(point[-2:] ** 2)

    def quantile(self, share: float) -> Float[np.ndarray, " n"]:
        """The coordinates of the parameters below which ``share`` of each one's prior lies, (n,)."""
        return self.free.widths * float(ndtri(share))
