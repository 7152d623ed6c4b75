"""Laws of single effects: at one instant, along a motion, and in the rig."""

from collections.abc import Callable, Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.small_root import solve_dense
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    Load,
    PortSignals,
)
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.quarter_car.catalogue import build_model
from savgs_ident.plants.quarter_car.plant import Loads
from savgs_ident.plants.quarter_car.rig import Rig

from ..plants.quarter_car.instants import NOMINAL, as_values, inputs_of, motion_of


def typical(effect: Effect, **others: float) -> Values:
    """The effect's own values, and others on top of them."""
    return as_values({each.name: each.value for each in effect.parameters} | others)


def signals(
    displacement: float = 0.0, velocity: float = 0.0, load: float = 0.0, rest: float = 0.0
) -> PortSignals:
    """What a port shows [m], [m/s], [N], [m]."""
    return PortSignals(*(jnp.asarray(each, float) for each in (displacement, velocity, load, rest)))


_force = eqx.filter_jit(lambda effect, p, seen: effect.force(p, seen, jnp.zeros(0)))


def force_of(
    effect: Effect,
    p: Values,
    displacement: float = 0.0,
    velocity: float = 0.0,
    load: float = 0.0,
    rest: float = 0.0,
) -> float:
    """Force [N] of an effect without states."""
    return float(_force(effect, p, signals(displacement, velocity, load, rest)))


def _settled(defect: Callable[[Array], Array], start: Array) -> Array:
    """Newton's method; what is linear takes one of the steps."""
    now = start
    for _ in range(4):
        columns = [jax.jvp(defect, (now,), (unit,))[1] for unit in jnp.unstack(jnp.eye(now.size))]
        now = now - solve_dense(jnp.stack(columns, axis=1), defect(now))
    return now


@eqx.filter_jit
def _followed(effect: Effect, p: Values, seen: PortSignals, start: Array, step: Array) -> Array:
    def advance(before: Array, at: PortSignals) -> tuple[Array, Array]:
        now = _settled(lambda now: now - before - step * effect.rate(p, at, now), before)
        return now, effect.force(p, at, now)

    return jax.lax.scan(advance, start, seen)[1]


def follow(
    effect: Effect, p: Values, displacement: NDArray[np.float64], step: float, start: float, rest: float = 0.0
) -> NDArray[np.float64]:
    """Force [N] along a displacement [m] sampled every ``step`` [s], from a state ``start``; backward Euler."""
    velocity = np.gradient(displacement, step)
    seen = PortSignals(
        *map(
            jnp.asarray,
            (displacement, velocity, np.zeros_like(displacement), np.full_like(displacement, rest)),
        )
    )
    return np.asarray(_followed(effect, p, seen, jnp.asarray([start]), jnp.asarray(step)))


@eqx.filter_jit
def _yielded(
    effect: Effect, p: Values, load: Callable[[Array, Array], Array], drive: Array, step: Array
) -> Array:
    def advance(before: Array, at: Array) -> tuple[Array, Array]:
        def defect(now: Array) -> Array:
            rate = (now - before) / step
            return effect.balance(p, Load(load(at, rate[0]), jnp.zeros(())), now, rate)

        now = _settled(defect, before)
        return now, now

    return jax.lax.scan(advance, jnp.zeros(len(effect.states)), drive)[1]


def give_way(
    effect: Effect,
    p: Values,
    drive: NDArray[np.float64],
    step: float,
    load: Callable[[Array, Array], Array] = lambda at, rate: at,
) -> NDArray[np.float64]:
    """States (n, s) under a load made of a drive (n,), sampled every ``step`` [s], and of the rate of giving way.

    Nothing is carried at rest.
    """
    return np.asarray(_yielded(effect, p, load, jnp.asarray(drive), jnp.asarray(step)))


def balance_of(
    effect: Effect, p: Values, total: float, rest: float, state: float, rate: float = 0.0
) -> float:
    """What vanishes for the right rate of an effect with one state."""
    load = Load(jnp.asarray(total), jnp.asarray(rest))
    return float(effect.balance(p, load, jnp.asarray([state]), jnp.asarray([rate]))[0])


def instant(**parts: float) -> NDArray[np.float64]:
    """The nominal state but for some parts of it (see tests/model/instants.py), named below."""
    out = NOMINAL.copy()
    for name, value in parts.items():
        out[_PLACES.index(name)] = value
    return out


_PLACES = ("z", "theta", "zd", "thetad", "zdd", "thetadd", "road", "roadd", "link", "linkd")


def in_the_rig(
    rig: Rig,
    numbers: Mapping[str, float],
    effects: tuple[str, ...],
    at: NDArray[np.float64],
    states: tuple[float, ...] = (),
) -> tuple[NDArray[np.float64], Loads]:
    """Residual and loads of the rig with some effects at an instant, their states still."""
    model, p = build_model(rig, effects), as_values(numbers)
    s = jnp.asarray(states or [0.0] * len(model.states), float)
    # Piece by piece, not compiled: each model is asked but a few times.
    seen = (p, motion_of(jnp.asarray(at)), s, jnp.zeros_like(s), inputs_of(jnp.asarray(at)), model.prepare(p))
    return np.asarray(model.residual(*seen)), model.loads(*seen)


def fundamental(values: NDArray[np.float64]) -> complex:
    """Complex amplitude of the first order of one period (n,)."""
    return complex(2.0 * np.fft.rfft(values)[1] / values.size)
