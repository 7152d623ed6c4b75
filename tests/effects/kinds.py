"""The effects of the catalogue by kind, and the law of each kind as one function of one vector.

A law is compared at the instants of a cycle: what it sees there (n, k) depends on its kind.

    force           displacement, velocity, load, states
    grip            displacement, velocity, load
    series          load, load at rest, states, their rates
    change          nothing
    road fault      height, velocity, angle of the cam, its speed
    sensor fault    frequency
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.model.effect import (
    AbstractChange,
    AbstractEffect,
    AbstractForce,
    AbstractGrip,
    AbstractRoadFault,
    AbstractSensorFault,
    AbstractSeries,
    Cam,
    Load,
    Port,
    PortSignals,
)
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values

from .cycles import Cycle, along_a_cycle

PORTS: dict[type[AbstractEffect], frozenset[Port]] = {
    AbstractForce: frozenset(
        {Port.RAIL, Port.STRUT, Port.SUSPENSION, Port.TYRE_RADIAL, Port.TYRE_LATERAL},
    ),
    AbstractGrip: frozenset({Port.RAIL}),
    AbstractSeries: frozenset({Port.STRUT, Port.LINK, Port.ROAD, Port.TYRE_LATERAL, Port.FRAME}),
    AbstractChange: frozenset(
        {Port.STRUT, Port.TYRE_RADIAL, Port.LINK, Port.INERTIA},
    ),
    AbstractRoadFault: frozenset({Port.ROAD}),
    AbstractSensorFault: frozenset({Port.SENSOR_SPRUNG_ACCEL, Port.SENSOR_SUSP_DEFLECTION}),
}
"""The kinds, and where each can act."""

MECHANISMS = (AbstractForce, AbstractGrip, AbstractSeries)
"""Kinds that take energy or store it; the others are errors of numbers, of the plate and of the sensors."""


def effects_of(*kinds: type[AbstractEffect]) -> list[Any]:
    """Parameters of a test: the catalogue's effects of some kinds, all without any."""
    kinds = kinds or (AbstractEffect,)
    return [pytest.param(effect, id=name) for name, effect in CATALOGUE.items() if isinstance(effect, kinds)]


def outcome(effect: AbstractEffect, p: Values, seen: Array) -> Array:
    """What an effect's law makes of what it sees at one instant, (m,)."""
    size = len(effect.states)
    match effect:
        case AbstractForce():
            signals, state = PortSignals(*jnp.unstack(seen[:3])), seen[3:]
            return jnp.append(effect.force(p, signals, state), effect.rate(p, signals, state))
        case AbstractGrip():
            return jnp.stack(effect.grip(p, PortSignals(*jnp.unstack(seen[:3]))))
        case AbstractSeries():
            load = Load(*jnp.unstack(seen[:2]))
            return effect.balance(p, load, seen[2 : 2 + size], seen[2 + size :])
        case AbstractChange():
            changes = effect.changes(p)
            return jnp.stack([changes[name] for name in sorted(changes)])
        case AbstractRoadFault():
            return jnp.stack(effect.shift(p, Road(*jnp.unstack(seen[:2])), Cam(*jnp.unstack(seen[2:]))))
        case AbstractSensorFault():
            transfer = effect.transfer(p, seen)[0]
            return jnp.stack([transfer.real, transfer.imag])
    raise TypeError(f"'{effect.name}' is of no kind")


def seen_by(effect: AbstractEffect, p: Values, seed: int) -> NDArray[np.float64]:
    """What an effect of any kind sees at many instants, (n, k): a mechanism along a cycle of its own states."""
    rng = np.random.default_rng(seed)
    if isinstance(effect, MECHANISMS):
        return seen_along(effect, along_a_cycle(effect, p, seed))
    if isinstance(effect, AbstractChange):
        return np.zeros((1, 0))
    if isinstance(effect, AbstractRoadFault):
        return rng.uniform(-1.0, 1.0, (64, 4)) * np.array([0.02, 0.4, np.pi, 30.0])
    return np.linspace(0.0, 60.0, 61)[:, None]


def seen_along(effect: AbstractEffect, cycle: Cycle) -> NDArray[np.float64]:
    """What a mechanism sees along a cycle."""
    if isinstance(effect, AbstractGrip):
        return cycle.drive
    columns = [cycle.drive, cycle.state]
    return np.hstack(columns if isinstance(effect, AbstractForce) else [*columns, cycle.rate])


def outcomes(effect: AbstractEffect, p: Values, seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """The law at many instants, (n, m)."""
    return np.asarray(jax.vmap(lambda one: outcome(effect, p, one))(jnp.asarray(seen)))


def slopes(
    effect: AbstractEffect, p: Values, direction: Values, seen: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Its derivatives in the parameters, along a direction of them."""
    at = jnp.asarray(seen)
    law = jax.vmap(lambda q, one: outcome(effect, q, one), in_axes=(None, 0))
    return np.asarray(jax.jvp(lambda q: law(q, at), (dict(p),), (dict(direction),))[1])
