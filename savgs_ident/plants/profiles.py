"""Functions of time: what a road's height or a link's angle may do.

Every profile has a value and, from it by differentiation, a rate; nobody writes a derivative twice.

    >>> profile = Sine(amplitude=0.01375, frequency=2.0, mean=0.0, phase=0.0, rise_time=0.0)
    >>> round(float(profile.value(jnp.asarray(0.5))), 6), round(float(profile.rate(jnp.asarray(0.5))), 6)
    (0.01375, 0.0)
"""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from numpy.typing import ArrayLike
from scipy.interpolate import Akima1DInterpolator

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Fundamental, InputSignal
from savgs_ident.plants.base import AbstractPlant, AbstractSource

Scalar = Float[Array, ""]

Number = Float[Array, ""] | float
"""A number that becomes an array on entry."""


class AbstractProfile(eqx.Module):
    """A quantity over time [s], continuously differentiable."""

    @abstractmethod
    def value(self, t: Scalar) -> Scalar:
        """The quantity at time ``t`` [s], in its own unit."""

    def rate(self, t: Scalar) -> Scalar:
        """Its time derivative [unit/s]."""
        return jax.jvp(self.value, (t,), (jnp.ones_like(t),))[1]


class Constant(AbstractProfile):
    """A quantity that stays as it is, in its unit."""

    level: Number = eqx.field(converter=jnp.asarray)

    def value(self, t: Scalar) -> Scalar:
        """The level, at any time."""
        return self.level + jnp.zeros_like(t)


class Sine(AbstractProfile):
    """mean + amplitude w(t) cos(2 pi f t + phase), where w rises smoothly from 0 to 1 in ``rise_time`` [s].

    ``amplitude`` and ``mean`` in the quantity's unit, ``frequency`` [Hz], ``phase`` [rad]. With
    ``rise_time`` = 0 the motion is steady from the start.
    """

    amplitude: Number = eqx.field(converter=jnp.asarray)
    frequency: Number = eqx.field(converter=jnp.asarray)
    mean: Number = eqx.field(converter=jnp.asarray)
    phase: Number = eqx.field(converter=jnp.asarray)
    rise_time: Number = eqx.field(converter=jnp.asarray)

    def value(self, t: Scalar) -> Scalar:
        """The quantity at time ``t`` [s]."""
        rises = self.rise_time > 0.0
        share = jnp.where(rises, t / jnp.where(rises, self.rise_time, 1.0), 1.0)
        wave = jnp.cos(2.0 * jnp.pi * self.frequency * t + self.phase)
        return self.mean + self.amplitude * _smooth_rise(share) * wave


def _smooth_rise(share: Scalar) -> Scalar:
    """From 0 to 1 over shares 0 to 1, twice continuously differentiable."""
    share = jnp.clip(share, 0.0, 1.0)
    return share**3 * (10.0 + share * (6.0 * share - 15.0))


class Offset(AbstractProfile):
    """A profile about a ``level``, in its unit, instead of about zero."""

    inner: AbstractProfile
    level: Number = eqx.field(converter=jnp.asarray)

    def value(self, t: Scalar) -> Scalar:
        """The quantity at time ``t`` [s]."""
        return self.level + self.inner.value(t)


class Faded(AbstractProfile):
    """A profile that grows from nothing during the first ``fade`` [s] and is gone ``fade`` after ``end`` [s]."""

    inner: AbstractProfile
    end: Number = eqx.field(converter=jnp.asarray)
    fade: Number = eqx.field(converter=jnp.asarray)

    def value(self, t: Scalar) -> Scalar:
        """The quantity at time ``t`` [s]."""
        going = 1.0 - _smooth_rise((t - self.end) / self.fade)
        return self.inner.value(t) * _smooth_rise(t / self.fade) * going


class LinearSweep(AbstractProfile):
    """amplitude sin(phi(t)) with a frequency dphi/dt that runs linearly and then stays.

    From ``start`` [Hz] at t = 0 to ``end`` [Hz] at t = ``duration`` [s]; phi is the integral of the frequency.
    A sweep from 0 Hz starts at rest.
    """

    amplitude: Number = eqx.field(converter=jnp.asarray)
    start: Number = eqx.field(converter=jnp.asarray)
    end: Number = eqx.field(converter=jnp.asarray)
    duration: Number = eqx.field(converter=jnp.asarray)

    def value(self, t: Scalar) -> Scalar:
        """The quantity at time ``t`` [s]."""
        return self.amplitude * jnp.sin(SweptAngle(self.start, self.end, self.duration, 0.0).value(t))


class SweptAngle(AbstractProfile):
    """An angle [rad] that is ``offset`` at t = 0, turning at a frequency that runs linearly and then stays.

    From ``start`` [Hz], before and at t = 0, to ``end`` [Hz] at t = ``duration`` [s].
    """

    start: Number = eqx.field(converter=jnp.asarray)
    end: Number = eqx.field(converter=jnp.asarray)
    duration: Number = eqx.field(converter=jnp.asarray)
    offset: Number = eqx.field(converter=jnp.asarray)

    def value(self, t: Scalar) -> Scalar:
        """The angle at time ``t`` [s]."""
        running = jnp.clip(t, 0.0, self.duration)
        slope = (self.end - self.start) / self.duration
        outside = self.start * jnp.minimum(t, 0.0) + self.end * jnp.maximum(t - self.duration, 0.0)
        turns = (self.start + 0.5 * slope * running) * running + outside
        return 2.0 * jnp.pi * turns + self.offset


class Tabulated(AbstractProfile):
    """A curve through knots, C1, that holds its first and last value outside them.

    ``time`` [s] of shape (n,), increasing; ``coefficients`` (n - 1, 4) of the cubic between each two knots in
    powers of the time since the earlier one, cubic first. ``first`` (n - 1,) is the last knot at or before the
    beginning of each of n - 1 equal parts of the time: where to look for a knot.
    """

    time: Float[Array, " n"]
    coefficients: Float[Array, "m 4"]
    first: Int[Array, " m"]

    def _piece(self, t: Scalar) -> Int[Array, ""]:
        parts = self.first.shape[0]
        share = (t - self.time[0]) / (self.time[-1] - self.time[0])
        part = jnp.clip((share * parts).astype(self.first.dtype), 0, parts - 1)

        def later(piece: Array) -> Array:
            return (piece < parts - 1) & (self.time[jnp.minimum(piece + 1, parts)] <= t)

        return jax.lax.while_loop(later, lambda piece: piece + 1, self.first[part])

    def value(self, t: Scalar) -> Scalar:
        """The quantity at time ``t`` [s]."""
        inside = jnp.clip(t, self.time[0], self.time[-1])
        piece = self._piece(jax.lax.stop_gradient(inside))
        cubic, square, slope, level = jnp.unstack(self.coefficients[piece])
        offset = inside - self.time[piece]
        return ((cubic * offset + square) * offset + slope) * offset + level


def tabulated(time: ArrayLike, values: ArrayLike, source: str = "") -> Tabulated:
    """The modified Akima curve through (time [s], values): C1 and local, so that it does not ring at a step.

    Raises :class:`InputError` for fewer than two points, arrays of unequal length, values that are not
    finite, or times that do not increase. Both are (n,), values in the unit of the quantity.
    """
    knots, levels = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    remedy = "give two or more points, finite, with times that increase"
    if knots.ndim != 1 or knots.shape != levels.shape or knots.size < 2:
        raise InputError("the profile is no table of times and values", source=source, remedy=remedy)
    if not (np.isfinite(knots).all() and np.isfinite(levels).all()):
        raise InputError("the profile has a value that is not finite", source=source, remedy=remedy)
    back = np.flatnonzero(np.diff(knots) <= 0.0)
    if back.size:
        raise InputError(
            "the time does not increase", source=source, time=float(knots[back[0] + 1]), remedy=remedy
        )
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            curve = Akima1DInterpolator(knots, levels, method="makima")
    except ValueError:
        raise InputError("the profile is too steep to be followed", source=source, remedy=remedy) from None
    if not np.isfinite(curve.c).all():
        raise InputError("the profile is too steep to be followed", source=source, remedy=remedy)
    parts = np.linspace(knots[0], knots[-1], knots.size)[:-1]
    first = np.searchsorted(knots, parts, side="right") - 1
    return Tabulated(jnp.asarray(knots), jnp.asarray(curve.c.T), jnp.asarray(first))


class ProfileSource(AbstractSource):
    """Inputs of any plant that follow given functions of time, one profile for each input.

    ``turning`` is the angle [rad] of a periodic test, where there is one.
    """

    profiles: tuple[AbstractProfile, ...]
    turning: AbstractProfile | None = None
    scales: ClassVar[tuple[float, ...]] = ()

    def at_rest(self, plant: AbstractPlant, t: Scalar) -> Any:
        """The values of the profiles at time ``t`` [s], standing still."""
        return plant.drive(tuple(InputSignal(each.value(t), jnp.zeros_like(t)) for each in self.profiles))

    def start(self, p: Values, t: Scalar, loads: Any) -> Float[Array, " k"]:
        """Nothing: there is no state."""
        return jnp.zeros(0)

    def inputs(self, plant: AbstractPlant, t: Scalar, state: Float[Array, " k"]) -> Any:
        """Values and rates of the profiles at time ``t`` [s]."""
        turned = None if self.turning is None else Fundamental(self.turning.value(t), self.turning.rate(t))
        return plant.drive(tuple(InputSignal(each.value(t), each.rate(t)) for each in self.profiles), turned)

    def rate(self, p: Values, t: Scalar, state: Float[Array, " k"], loads: Any) -> Float[Array, " k"]:
        """Nothing: there is no state."""
        return jnp.zeros(0)
