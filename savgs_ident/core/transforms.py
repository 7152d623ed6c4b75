"""One transform and one prior for every parameter, for all that estimates it: fit, posterior and diagnosis.

A transform is a smooth one-to-one map from the whole line to the open range of a parameter. A solver works on the
coordinate u without bounds; the model only ever sees values strictly inside them. At u = 0 stands the table's value
(moved inside a little where it is a bound, for there the slope would be zero). There are five
(:func:`transform_of`): the first for a parameter with a tolerance, the second for a typical one, the others for the
rest, by their bounds.

- :class:`Tolerated`: v = v0 + sigma s(u), a parameter in standard deviations of what is known of it. s is
  exactly u up to half way to a bound and bends towards it beyond, twice differentiable.
- :class:`Rough`: v = v0 10^s(u).
- :class:`OneSided`: v = bound + scale exp(u) above a bound, v = bound - scale exp(-u) below one.
- :class:`TwoSided`: v = lower + (upper - lower) / (1 + exp(-(u + offset))): logarithmic near either bound.
- :class:`Unbounded`: v = v0 + scale u.

    >>> friction = transform_of(Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5))
    >>> round(friction.inverse(0.03), 12), bool(friction.forward(jnp.array(-50.0)) > 0.0)
    (0.0, True)

The prior is normal on the coordinate, about 0 with the standard deviation of :func:`prior_width`: 1 where a tolerance
is known, whether the parameter is to be identified or not, and :data:`WIDTH` where nothing is. What is no more than
typical is known to an order of magnitude (:class:`Rough`).

The parameters of a table that may move form a :class:`FreeVector` of coordinates. *Identified* ones, which are asked
for, come first, then those *tolerated* ones that are estimated along.

    >>> table = ParameterTable((
    ...     Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5),
    ...     Parameter("k_t", 275e3, "N/m", tolerance=13.75e3, lower=0.0),
    ... ))
    >>> free = FreeVector(table, identified=("mu_r",), tolerated=("k_t",))
    >>> values = free.to_constrained(jnp.array([0.0, -1.0]))
    >>> [f"{name} = {float(value):.6g}" for name, value in values.items()]
    ['mu_r = 0.03', 'k_t = 261250']
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from math import exp, inf, isfinite, log, sqrt
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import expit

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable

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

_INSIDE = 0.01
# Without a bound the map bends only this many standard deviations away: finite, to keep slopes finite.
_FAR = 1e12


class AbstractBijection(eqx.Module):
    """A smooth, increasing map from an unconstrained coordinate to the open range of a parameter.

    ``forward`` works element by element, on numbers and on arrays of NumPy or JAX: maps of one kind may be stacked,
    each field an array (k,).
    """

    @abstractmethod
    def forward(self, u: Any) -> Any:
        """The value [unit of the parameter] at the unconstrained coordinate ``u`` [1], a number or (k,)."""

    @abstractmethod
    def inverse(self, value: float) -> float:
        """The unconstrained coordinate [1] of a ``value`` strictly inside the range."""

    @abstractmethod
    def slope(self, u: float) -> float:
        """d value / du at a number ``u`` [unit of the parameter]."""


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

    def inverse(self, value: float) -> float:
        """Standard deviations of ``value`` from the nominal one, unbent."""
        deviation = (value - self.nominal) / self.tolerance
        for sign, room in ((1.0, self.above), (-1.0, self.below)):
            half = 0.5 * room
            if sign * deviation > half:
                share = sign * deviation / half - 1.0
                return sign * half * (1.0 + share / sqrt(1.0 - share * share))
        return deviation

    def slope(self, u: float) -> float:
        """d value / du, the tolerance up to half way to a bound."""
        half = 0.5 * (self.above if u > 0.0 else self.below)
        beyond = max(abs(u) / half - 1.0, 0.0)
        return self.tolerance / (1.0 + beyond * beyond) ** 1.5


class Rough(AbstractBijection):
    """Orders of magnitude from a typical value, :class:`Tolerated` as a logarithm: never more than three of them."""

    nominal: float
    orders: Tolerated

    def forward(self, u: Any) -> Any:
        """The value at ``u`` orders of magnitude."""
        return self.nominal * _array_module(u).exp(self.orders.forward(u))

    def inverse(self, value: float) -> float:
        """Orders of magnitude of ``value`` from the typical one, unbent."""
        return self.orders.inverse(log(value / self.nominal))

    def slope(self, u: float) -> float:
        """d value / du."""
        return float(self.forward(u)) * self.orders.slope(u)


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

    def inverse(self, value: float) -> float:
        """The log distance of ``value`` from the bound."""
        return self.sign * log(self.sign * (value - self.bound) / self.scale)

    def slope(self, u: float) -> float:
        """d value / du, the distance from the bound."""
        return self.scale * exp(self.sign * u)


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

    def inverse(self, value: float) -> float:
        """The place of ``value`` on the curve."""
        return _logit(value, self.lower, self.upper) - self.offset

    def slope(self, u: float) -> float:
        """d value / du."""
        shifted = u + self.offset
        return (self.upper - self.lower) * float(expit(shifted)) * float(expit(-shifted))


class Unbounded(AbstractBijection):
    """A shift and a scale, for a parameter without bounds, both in its unit."""

    nominal: float
    scale: float

    def forward(self, u: Any) -> Any:
        """The value at ``u`` scales from the start."""
        return self.nominal + self.scale * u

    def inverse(self, value: float) -> float:
        """The scales of ``value`` from the start."""
        return (value - self.nominal) / self.scale

    def slope(self, u: float) -> float:
        """d value / du, the scale."""
        return self.scale


def transform_of(parameter: Parameter) -> AbstractBijection:
    """The map of a parameter, by what is known of it beforehand.

    A tolerance about a value that is itself a bound, as that of an effect at its null, is no more than a scale.
    Raises :class:`InputError` if nothing about the parameter gives a scale.
    """
    if parameter.rough:
        return _rough_bijection(parameter)
    inside = parameter.lower < parameter.value < parameter.upper
    return (
        tolerated_bijection(parameter)
        if parameter.tolerance > 0.0 and inside
        else identified_bijection(parameter)
    )


def prior_width(parameter: Parameter) -> float:
    """Standard deviation of a parameter's coordinate before the data [1]."""
    return 1.0 if isinstance(transform_of(parameter), Tolerated | Rough) else WIDTH


def _rough_bijection(parameter: Parameter) -> Rough:
    below, above = (
        min(_ORDERS, abs(log(parameter.value / bound)) / ORDER) if 0.0 < bound < inf else _ORDERS
        for bound in (parameter.lower, parameter.upper)
    )
    return Rough(parameter.value, Tolerated(0.0, ORDER, below, above))


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


def _logit(value: float, lower: float, upper: float) -> float:
    return log(value - lower) - log(upper - value)


class FreeVector(eqx.Module):
    """Named parameters of a table on unconstrained coordinates, u = 0 at the table's values.

    It holds no arrays: close over it or pass it through any JAX transformation.

    Raises :class:`InputError` for a name that the table does not have, a name given twice, a tolerated
    parameter without tolerance or on its bound, an identified one whose scale nothing gives.
    """

    identified: tuple[str, ...] = eqx.field(static=True)
    tolerated: tuple[str, ...] = eqx.field(static=True)
    parameters: tuple[Parameter, ...] = eqx.field(static=True)

    def __init__(
        self, table: ParameterTable, identified: Sequence[str], tolerated: Sequence[str] = ()
    ) -> None:
        self.identified = tuple(identified)
        self.tolerated = tuple(tolerated)
        _check_names(table, self.names)
        self.parameters = tuple(table[name] for name in self.names)
        self._bijections()  # A parameter that has none is refused here, not at the first use.

    @property
    def names(self) -> tuple[str, ...]:
        """All n names in the order of the vector: identified ones first."""
        return self.identified + self.tolerated

    def to_unconstrained(self, values: Mapping[str, float]) -> Float[Array, " n"]:
        """The vector (n,) [1] of the given SI values; a value on a bound is moved inside a little.

        ``values`` may hold other names too. Raises :class:`InputError` for a missing name or a value outside
        its bounds. Not for use inside a JAX transformation.
        """
        missing = [name for name in self.names if name not in values]
        if missing:
            raise InputError(f"the value of parameter '{missing[0]}' is missing", remedy="give all free ones")
        inside = [move_inside(parameter, float(values[parameter.name])) for parameter in self.parameters]
        pairs = zip(self._bijections(), inside, strict=True)
        return jnp.asarray([bijection.inverse(value) for bijection, value in pairs], float)

    def to_constrained(self, u: Float[Array, " n"]) -> dict[str, Float[Array, ""]]:
        """Name to SI value, strictly inside the bounds, at the vector ``u`` (n,) [1]."""
        return dict(zip(self.names, jnp.unstack(self._values(u)), strict=True))

    def jacobian_diag(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        """d value / d u of every parameter at ``u`` (n,) [SI unit of each]; the Jacobian is diagonal."""
        return jax.jvp(self._values, (u,), (jnp.ones_like(u),))[1]

    @property
    def widths(self) -> Float[np.ndarray, " n"]:
        """Standard deviations of the coordinates before the data [1]."""
        return np.array([prior_width(parameter) for parameter in self.parameters])

    def prior_residuals(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        """The coordinates in their standard deviations before the data [1].

        Half their sum of squares is minus the log prior, but for a constant.
        """
        return u / self.widths

    def _bijections(self) -> list[AbstractBijection]:
        split = len(self.identified)
        return [transform_of(parameter) for parameter in self.parameters[:split]] + [
            transform_of(parameter) if parameter.rough else tolerated_bijection(parameter)
            for parameter in self.parameters[split:]
        ]

    @eqx.filter_jit
    def _values(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        # All maps of one kind in one operation: dozens of scalar ones would take a second to compile.
        values = jnp.zeros_like(u)
        bijections = self._bijections()
        for kind in dict.fromkeys(type(bijection) for bijection in bijections):
            places = [place for place, bijection in enumerate(bijections) if type(bijection) is kind]
            stacked = jax.tree.map(lambda *leaves: np.array(leaves), *(bijections[place] for place in places))
            values = values.at[np.array(places)].set(stacked.forward(u[np.array(places)]))
        return values


def known_to_tolerance(table: ParameterTable, identified: Sequence[str] = ()) -> tuple[str, ...]:
    """The names in ``table`` that carry a tolerance, or are typical, and are not ``identified``, in its order."""
    known = (entry.name for entry in table.entries if entry.tolerance > 0.0 or entry.rough)
    return tuple(name for name in known if name not in identified)


def _check_names(table: ParameterTable, names: tuple[str, ...]) -> None:
    for position, name in enumerate(names):
        if name not in table:
            raise InputError(f"there is no parameter '{name}'", remedy="choose among: " + ", ".join(table))
        if name in names[:position]:
            raise InputError(f"parameter '{name}' is free twice", remedy="name it once")
