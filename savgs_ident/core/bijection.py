"""Smooth one-to-one maps from the whole line to the open range of a parameter.

A solver works on u without bounds; the model only ever sees values strictly inside them. At u = 0 stands the
table's value (moved inside a little where it is a bound, for there the slope would be zero).

- :class:`Tolerated`: v = v0 + sigma s(u), a parameter in standard deviations of what is known of it. s is
  exactly u up to half way to a bound and bends towards it beyond, twice differentiable.
- :class:`OneSided`: v = bound + scale exp(u) above a bound, v = bound - scale exp(-u) below one.
- :class:`TwoSided`: v = lower + (upper - lower) / (1 + exp(-(u + offset))): logarithmic near either bound.
- :class:`Unbounded`: v = v0 + scale u.

    >>> friction = identified_bijection(Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5))
    >>> round(friction.inverse(0.03), 12), bool(friction.forward(jnp.array(-50.0)) > 0.0)
    (0.0, True)
"""

from abc import abstractmethod
from math import isfinite, log, sqrt

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter

# Near a bound single precision leaves no digits to differentiate.
jax.config.update("jax_enable_x64", True)

_INSIDE = 0.01
# Without a bound the map bends only this many standard deviations away: finite, to keep slopes finite.
_FAR = 1e12


class AbstractBijection(eqx.Module):
    """A smooth, increasing map from an unconstrained coordinate to the open range of a parameter.

    ``forward`` works element by element: maps of one kind may be stacked, each field an array (k,).
    """

    @abstractmethod
    def forward(self, u: Float[Array, "*k"]) -> Float[Array, "*k"]:
        """The value [unit of the parameter] at the unconstrained coordinate ``u`` [1]."""

    @abstractmethod
    def inverse(self, value: float) -> float:
        """The unconstrained coordinate [1] of a ``value`` strictly inside the range."""


class Tolerated(AbstractBijection):
    """Standard deviations from the nominal value, bending only in the outer half of the way to a bound.

    ``below`` and ``above`` are the distances from the nominal value to the bounds, in standard deviations.
    """

    nominal: float
    tolerance: float
    below: float
    above: float

    def forward(self, u: Float[Array, "*k"]) -> Float[Array, "*k"]:
        """The value at ``u`` standard deviations."""
        low, high = -0.5 * self.below, 0.5 * self.above
        towards_upper = high + high * _saturate((u - high) / high)
        towards_lower = low - low * _saturate((low - u) / low)
        deviation = jnp.where(u > high, towards_upper, jnp.where(u < low, towards_lower, u))
        return self.nominal + self.tolerance * deviation

    def inverse(self, value: float) -> float:
        """Standard deviations of ``value`` from the nominal one, unbent."""
        deviation = (value - self.nominal) / self.tolerance
        for sign, room in ((1.0, self.above), (-1.0, self.below)):
            half = 0.5 * room
            if sign * deviation > half:
                share = sign * deviation / half - 1.0
                return sign * half * (1.0 + share / sqrt(1.0 - share * share))
        return deviation


class OneSided(AbstractBijection):
    """The log of the distance to one bound; ``sign`` is 1 for a lower bound and -1 for an upper one.

    ``bound`` and ``scale`` are in the unit of the parameter.
    """

    bound: float
    scale: float
    sign: float

    def forward(self, u: Float[Array, "*k"]) -> Float[Array, "*k"]:
        """The value at log distance ``u``."""
        return self.bound + self.sign * self.scale * jnp.exp(self.sign * u)

    def inverse(self, value: float) -> float:
        """The log distance of ``value`` from the bound."""
        return self.sign * log(self.sign * (value - self.bound) / self.scale)


class TwoSided(AbstractBijection):
    """A logistic curve between two bounds, through the start value at u = 0.

    Bounds are in the unit of the parameter; ``offset`` is the place of the start on the curve [1].
    """

    lower: float
    upper: float
    offset: float

    def forward(self, u: Float[Array, "*k"]) -> Float[Array, "*k"]:
        """The value at ``u`` on the curve."""
        # Each half from its own bound, so that the distance to a near bound keeps all its digits.
        shifted = u + self.offset
        width = self.upper - self.lower
        from_lower = self.lower + width * jax.nn.sigmoid(shifted)
        from_upper = self.upper - width * jax.nn.sigmoid(-shifted)
        return jnp.where(shifted < 0.0, from_lower, from_upper)

    def inverse(self, value: float) -> float:
        """The place of ``value`` on the curve."""
        return _logit(value, self.lower, self.upper) - self.offset


class Unbounded(AbstractBijection):
    """A shift and a scale, for a parameter without bounds, both in its unit."""

    nominal: float
    scale: float

    def forward(self, u: Float[Array, "*k"]) -> Float[Array, "*k"]:
        """The value at ``u`` scales from the start."""
        return self.nominal + self.scale * u

    def inverse(self, value: float) -> float:
        """The scales of ``value`` from the start."""
        return (value - self.nominal) / self.scale


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
    Raises :class:`InputError` for a value outside the bounds, or on a bound where nothing tells the room.
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
            f"nothing tells the scale of parameter '{parameter.name}'",
            remedy="give it a tolerance, another bound, or a start value off its bound",
        )
    return room


def _saturate(x: Float[Array, "*k"]) -> Float[Array, "*k"]:
    return x / jnp.sqrt(1.0 + x * x)


def _logit(value: float, lower: float, upper: float) -> float:
    return log(value - lower) - log(upper - value)
