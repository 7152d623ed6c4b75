"""The effects of the catalogue by kind, and the law of each kind as one function of one vector.

A law is compared at the instants of a cycle: what it sees there (n, k) depends on its kind.

    force           displacement, velocity, load, rest, states
    friction limit  displacement, velocity, load, rest
    series          load, load at rest, states, their rates
    number          nothing
    input           value, rate, angle of the fundamental, its speed
    sensor          frequency
"""

from collections.abc import Callable
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    AbstractInputLaw,
    AbstractNumberLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
    Fundamental,
    InputSignal,
    Load,
    PortSignals,
)
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.foreign_laws import FOREIGN

from .cycles import Cycle, along_a_cycle

KINDS = (
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    AbstractSeriesLaw,
    AbstractNumberLaw,
    AbstractInputLaw,
    AbstractSensorLaw,
)
"""The kinds of laws."""

MECHANISMS = (AbstractForceLaw, AbstractFrictionLimitLaw, AbstractSeriesLaw)
"""Kinds that take energy or store it; the others are errors of numbers, of the plate and of the sensors."""


FOREIGN_EFFECTS = {name: each.effect for name, each in FOREIGN.items()}
"""Effects that no catalogue has, by name."""


def effects_of(*kinds: type) -> list[Effect]:
    """The catalogue's effects whose laws are of some kinds, all without any."""
    return [effect for effect in CATALOGUE.values() if isinstance(effect.law, kinds or KINDS)]


def outcome(effect: Effect, p: Values, seen: Array) -> Array:
    """What an effect's law makes of what it sees at one instant, (m,)."""
    size = len(effect.states)
    match effect.law:
        case AbstractForceLaw():
            signals, state = PortSignals(*jnp.unstack(seen[:4])), seen[4:]
            return jnp.append(effect.force(p, signals, state), effect.rate(p, signals, state))
        case AbstractFrictionLimitLaw():
            return jnp.stack(effect.friction_limit(p, PortSignals(*jnp.unstack(seen))))
        case AbstractSeriesLaw():
            load = Load(*jnp.unstack(seen[:2]))
            return effect.balance(p, load, seen[2 : 2 + size], seen[2 + size :])
        case AbstractNumberLaw():
            changes = effect.changes(p)
            return jnp.stack([changes[name] for name in sorted(changes)])
        case AbstractInputLaw():
            return jnp.stack(
                effect.shift(p, InputSignal(*jnp.unstack(seen[:2])), Fundamental(*jnp.unstack(seen[2:])))
            )
        case AbstractSensorLaw():
            transfer = effect.transfer(p, seen)[0]
            return jnp.stack([transfer.real, transfer.imag])
    raise TypeError(f"'{effect.name}' is of no kind")


def seen_by(effect: Effect, p: Values, seed: int) -> NDArray[np.float64]:
    """What an effect of any kind sees at many instants, (n, k): a mechanism along a cycle of its own states."""
    rng = np.random.default_rng(seed)
    if isinstance(effect.law, MECHANISMS):
        return seen_along(effect, along_a_cycle(effect, p, seed))
    if isinstance(effect.law, AbstractNumberLaw):
        return np.zeros((1, 0))
    if isinstance(effect.law, AbstractInputLaw):
        return rng.uniform(-1.0, 1.0, (64, 4)) * np.array([0.02, 0.4, np.pi, 30.0])
    return np.linspace(0.0, 60.0, 61)[:, None]


def seen_along(effect: Effect, cycle: Cycle) -> NDArray[np.float64]:
    """What a mechanism sees along a cycle."""
    if isinstance(effect.law, AbstractFrictionLimitLaw):
        return cycle.drive
    columns = [cycle.drive, cycle.state]
    return np.hstack(columns if isinstance(effect.law, AbstractForceLaw) else [*columns, cycle.rate])


@cache
def _compiled(name: str) -> Callable[[Values, Array], Array]:
    effect = {**CATALOGUE, **FOREIGN_EFFECTS}[name]
    return jax.jit(jax.vmap(lambda p, one: outcome(effect, p, one), in_axes=(None, 0)))


@cache
def _compiled_slopes(name: str) -> Callable[[Values, Values, Array], Array]:
    law = _compiled(name)
    return jax.jit(lambda p, direction, seen: jax.jvp(lambda q: law(q, seen), (p,), (direction,))[1])


def outcomes(effect: Effect, p: Values, seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """The law at many instants, (n, m)."""
    return np.asarray(_compiled(effect.name)(dict(p), jnp.asarray(seen)))


def slopes(effect: Effect, p: Values, direction: Values, seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """Its derivatives in the parameters, along a direction of them."""
    return np.asarray(_compiled_slopes(effect.name)(dict(p), dict(direction), jnp.asarray(seen)))
