"""One transform and one prior for every parameter, for all that estimates it: fit, posterior and diagnosis.

A transform is a smooth one-to-one map from the whole line to the open range of a parameter. A solver works on the
coordinate u without bounds; the model only ever sees values strictly inside them. At u = 0 stands the table's value
(moved inside a little where it is a bound, for there the slope would be zero). There are five
(:func:`transform_of`): the first for a parameter with a tolerance, the second for a typical one, the others for the
rest, by their bounds.

- :class:`Tolerated`: v = v0 + sigma s(u), a parameter in standard deviations of what is known of it. s is
  exactly u up to half way to a bound and bends towards it beyond, twice differentiable.
- :class:`OrdersOfMagnitude`: v = v0 10^s(u).
- :class:`OneSided`: v = bound + scale exp(u) above a bound, v = bound - scale exp(-u) below one.
- :class:`TwoSided`: v = lower + (upper - lower) / (1 + exp(-(u + offset))): logarithmic near either bound.
- :class:`Unbounded`: v = v0 + scale u.

    >>> friction = transform_of(Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5))
    >>> round(float(friction.inverse(0.03)), 12), bool(friction.forward(jnp.array(-50.0)) > 0.0)
    (0.0, True)

The prior is normal on the coordinate, about 0 with the standard deviation of :func:`prior_width`: 1 where a tolerance
is known, whether the parameter is to be identified or not, and :data:`WIDTH` where nothing is. What is no more than
typical is known to an order of magnitude (:class:`OrdersOfMagnitude`).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from math import exp, inf, isfinite, log
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import expit

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter

# Near a bound single precision leaves no digits to differentiate.
jax.config.update("jax_enable_x64", True)

WIDTH = 3.0
"""Standard deviation before the data of the coordinate of a parameter without tolerance [e-folds near a bound].

A factor of twenty either way. An estimate to 1 % that is a factor of two off its start moves by less than a
thousandth of its standard error; a parameter that the data do not identify keeps a finite spread.
"""

ORDER = log(10.0)
"""Standard deviation before the data of the logarithm of a number that stands for an order of magnitude alone."""

_ORDERS = 3.0
"""Most orders of magnitude that such a number is off. Beyond, a contact is as hard as any, and no motion is found."""

# Searches ask for the maps of their parameters at every step.
_KEPT = 4096

_INSIDE = 0.01
# Without a bound the map bends only this many standard deviations away: finite, to keep slopes finite.
_FAR = 1e12


class AbstractBijection(ABC):
    """A smooth, increasing map from an unconstrained coordinate to the open range of a parameter.

    ``forward`` and ``inverse`` work element by element, on numbers and on arrays of NumPy or JAX: maps of one kind
    may be stacked, each field an array (k,).
    """

    @abstractmethod
    def forward(self, u: Any) -> Any:
        """The value [unit of the parameter] at the unconstrained coordinate ``u`` [1], a number or (k,)."""

    @abstractmethod
    def inverse(self, value: Any) -> Any:
        """The unconstrained coordinate [1] of a ``value`` strictly inside the range, a number or (k,)."""

    @abstractmethod
    def slope(self, u: float) -> float:
        """d value / du at a number ``u`` [unit of the parameter]."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Tolerated(AbstractBijection):
    """Standard deviations from the nominal value, bending only in the outer half of the way to a bound.

    ``below`` and ``above`` are the distances from the nominal value to the bounds, in standard deviations.
    """

    nominal: float
    tolerance: float
    below: float
    above: float

    def forward(self, u: Any) -> Any:
        """The value at ``u`` standard deviations."""
        xp = _array_module(u)
        low, high = -0.5 * self.below, 0.5 * self.above
        towards_upper = high + high * _saturate((u - high) / high)
        towards_lower = low - low * _saturate((low - u) / low)
        deviation = xp.where(u > high, towards_upper, xp.where(u < low, towards_lower, u))
        return self.nominal + self.tolerance * deviation

    def inverse(self, value: Any) -> Any:
        """Standard deviations of ``value`` from the nominal one, unbent."""
        xp = _array_module(value)
        low, high = -0.5 * self.below, 0.5 * self.above
        deviation = (value - self.nominal) / self.tolerance
        above = high + high * _spread(xp.maximum(deviation / high - 1.0, 0.0))
        below = low + low * _spread(xp.maximum(deviation / low - 1.0, 0.0))
        return xp.where(deviation > high, above, xp.where(deviation < low, below, deviation))

    def slope(self, u: float) -> float:
        """d value / du, the tolerance up to half way to a bound."""
        half = 0.5 * (self.above if u > 0.0 else self.below)
        beyond = max(abs(u) / half - 1.0, 0.0)
        return self.tolerance / (1.0 + beyond * beyond) ** 1.5


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class OrdersOfMagnitude(AbstractBijection):
    """Orders of magnitude from a typical value, :class:`Tolerated` as a logarithm: never more than three of them."""

    nominal: float
    orders: Tolerated

    def forward(self, u: Any) -> Any:
        """The value at ``u`` orders of magnitude."""
        return self.nominal * _array_module(u).exp(self.orders.forward(u))

    def inverse(self, value: Any) -> Any:
        """Orders of magnitude of ``value`` from the typical one, unbent."""
        return self.orders.inverse(_array_module(value).log(value / self.nominal))

    def slope(self, u: float) -> float:
        """d value / du."""
        return float(self.forward(u)) * self.orders.slope(u)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class OneSided(AbstractBijection):
    """The log of the distance to one bound; ``sign`` is 1 for a lower bound and -1 for an upper one.

    ``bound`` and ``scale`` are in the unit of the parameter.
    """

    bound: float
    scale: float
    sign: float

    def forward(self, u: Any) -> Any:
        """The value at log distance ``u``."""
        return self.bound + self.sign * self.scale * _array_module(u).exp(self.sign * u)

    def inverse(self, value: Any) -> Any:
        """The log distance of ``value`` from the bound."""
        return self.sign * _array_module(value).log(self.sign * (value - self.bound) / self.scale)

    def slope(self, u: float) -> float:
        """d value / du, the distance from the bound."""
        return self.scale * exp(self.sign * u)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TwoSided(AbstractBijection):
    """A logistic curve between two bounds, through the start value at u = 0.

    Bounds are in the unit of the parameter; ``offset`` is the place of the start on the curve [1].
    """

    lower: float
    upper: float
    offset: float

    def forward(self, u: Any) -> Any:
        """The value at ``u`` on the curve."""
        # Each half from its own bound, so that the distance to a near bound keeps all its digits.
        xp, sigmoid = (jnp, jax.nn.sigmoid) if isinstance(u, jax.Array) else (np, expit)
        shifted = u + self.offset
        width = self.upper - self.lower
        from_lower = self.lower + width * sigmoid(shifted)
        from_upper = self.upper - width * sigmoid(-shifted)
        return xp.where(shifted < 0.0, from_lower, from_upper)

    def inverse(self, value: Any) -> Any:
        """The place of ``value`` on the curve."""
        return _logit(value, self.lower, self.upper) - self.offset

    def slope(self, u: float) -> float:
        """d value / du."""
        shifted = u + self.offset
        return (self.upper - self.lower) * float(expit(shifted)) * float(expit(-shifted))


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Unbounded(AbstractBijection):
    """A shift and a scale, for a parameter without bounds, both in its unit."""

    nominal: float
    scale: float

    def forward(self, u: Any) -> Any:
        """The value at ``u`` scales from the start."""
        return self.nominal + self.scale * u

    def inverse(self, value: Any) -> Any:
        """The scales of ``value`` from the start."""
        return (value - self.nominal) / self.scale

    def slope(self, u: float) -> float:
        """d value / du, the scale."""
        return self.scale


@lru_cache(_KEPT)
def transform_of(parameter: Parameter) -> AbstractBijection:
    """The map of a parameter, by what is known of it beforehand.

    A tolerance about a value that is itself a bound, as that of an effect at its null, is no more than a scale.
    Raises :class:`InputError` if nothing about the parameter gives a scale.
    """
    if parameter.is_typical:
        return _typical_bijection(parameter)
    inside = parameter.lower < parameter.value < parameter.upper
    return (
        tolerated_bijection(parameter)
        if parameter.tolerance > 0.0 and inside
        else identified_bijection(parameter)
    )


@lru_cache(_KEPT)
def prior_width(parameter: Parameter) -> float:
    """Standard deviation of a parameter's coordinate before the data [1]."""
    return 1.0 if isinstance(transform_of(parameter), Tolerated | OrdersOfMagnitude) else WIDTH


def _typical_bijection(parameter: Parameter) -> OrdersOfMagnitude:
    below, above = (
        min(_ORDERS, abs(log(parameter.value / bound)) / ORDER) if 0.0 < bound < inf else _ORDERS
        for bound in (parameter.lower, parameter.upper)
    )
    return OrdersOfMagnitude(parameter.value, Tolerated(0.0, ORDER, below, above))


def identified_bijection(parameter: Parameter) -> AbstractBijection:
    """The map for a parameter of which nothing is known beforehand but its bounds.

    Raises :class:`InputError` if nothing about the parameter gives a scale (a start on its only bound, or at
    zero without bounds, and no tolerance).
    """
    start = move_inside(parameter, parameter.value)
    lower, upper = parameter.lower, parameter.upper
    if isfinite(lower) and isfinite(upper):
        return TwoSided(lower, upper, _logit(start, lower, upper))
    if isfinite(lower):
        return OneSided(lower, start - lower, 1.0)
    if isfinite(upper):
        return OneSided(upper, upper - start, -1.0)
    return Unbounded(start, _room(parameter))


def tolerated_bijection(parameter: Parameter) -> AbstractBijection:
    """The map for a parameter known to a tolerance: its prior is the unit normal on the coordinate.

    Raises :class:`InputError` for a parameter without tolerance, or one whose nominal value is on a bound.
    """
    if parameter.tolerance == 0.0:
        raise InputError(
            f"parameter '{parameter.name}' has no tolerance",
            remedy="identify it, or leave it exact",
        )
    below = min((parameter.value - parameter.lower) / parameter.tolerance, _FAR)
    above = min((parameter.upper - parameter.value) / parameter.tolerance, _FAR)
    if below == 0.0 or above == 0.0:
        raise InputError(
            f"parameter '{parameter.name}' has a tolerance, but its value is a bound",
            remedy="widen the bounds, or identify the parameter",
        )
    return Tolerated(parameter.value, parameter.tolerance, below, above)


def move_inside(parameter: Parameter, value: float) -> float:
    """``value`` [unit of the parameter] itself, or a hundredth of the room off the bound that it is on.

    Room is the distance of the bounds or, with one bound, from it to the table's value, or the tolerance.
    Raises :class:`InputError` for a value outside the bounds, or on a bound where nothing gives the room.
    """
    if not parameter.lower <= value <= parameter.upper:
        raise InputError(
            f"parameter '{parameter.name}' = {value} {parameter.unit} lies outside its bounds"
            f" [{parameter.lower}, {parameter.upper}]",
            remedy="choose a value inside",
        )
    if value == parameter.lower:
        return value + _INSIDE * _room(parameter)
    if value == parameter.upper:
        return value - _INSIDE * _room(parameter)
    return value


def _room(parameter: Parameter) -> float:
    lower, upper = parameter.lower, parameter.upper
    if isfinite(lower) and isfinite(upper):
        room = upper - lower
    else:
        origin = next((bound for bound in (lower, upper) if isfinite(bound)), 0.0)
        room = max(abs(parameter.value - origin), parameter.tolerance)
    if room == 0.0:
        raise InputError(
            f"nothing gives the scale of parameter '{parameter.name}'",
            remedy="give it a tolerance, another bound, or a start value off its bound",
        )
    return room


def _array_module(x: Any) -> Any:
    """NumPy for numbers, which is a hundred times as fast for one, JAX for its own arrays."""
    return jnp if isinstance(x, jax.Array) else np


def _saturate(x: Any) -> Any:
    return x / _array_module(x).sqrt(1.0 + x * x)


def _spread(x: Any) -> Any:
    """What :func:`_saturate` makes ``x``, which is below one, of."""
    return x / _array_module(x).sqrt(1.0 - x * x)


def _logit(value: Any, lower: float, upper: float) -> Any:
    xp = _array_module(value)
    return xp.log(value - lower) - xp.log(upper - value)
