"""How the effects of a model act together at a port: forces add up, what gives way adds up under one load.

Functions that evaluate a state's law put its balance into ``balances``, by effect.
"""

from collections.abc import Iterator
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.effect import (
    AbstractEffect,
    AbstractForce,
    AbstractGrip,
    AbstractRoadFault,
    AbstractSeries,
    Cam,
    Grip,
    Port,
    PortSignals,
)
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values


class Part(NamedTuple):
    """An effect with its states and their rates."""

    effect: AbstractEffect
    state: Float[Array, " s"]
    rate: Float[Array, " s"]


def series_at(parts: tuple[Part, ...], port: Port, in_damper: bool) -> Iterator[tuple[AbstractSeries, Part]]:
    for part in parts:
        effect = part.effect
        if isinstance(effect, AbstractSeries) and effect.port is port and effect.in_damper is in_damper:
            yield effect, part


def gives_way(
    parts: tuple[Part, ...], port: Port, zero: Array, in_damper: bool = False
) -> tuple[Array, Array]:
    """By how much everything in series at a port gives way, and how fast."""
    way, speed = zero, zero
    for _, part in series_at(parts, port, in_damper):
        way, speed = way + part.state[0], speed + part.rate[0]
    return way, speed


def put_under_load(
    parts: tuple[Part, ...],
    port: Port,
    p: Values,
    load: Array,
    balances: dict[str, Array],
    in_damper: bool = False,
) -> None:
    """Balances of everything in series at a port under its load."""
    for effect, part in series_at(parts, port, in_damper):
        balances[effect.name] = effect.balance(p, load, part.state, part.rate)


def force_at(
    parts: tuple[Part, ...], port: Port, p: Values, signals: PortSignals, balances: dict[str, Array]
) -> Array:
    """Force of all effects at a port; balances of their states."""
    total = jnp.zeros_like(signals.displacement)
    for effect, state, rate in parts:
        if isinstance(effect, AbstractForce) and effect.port is port:
            total = total + effect.force(p, signals, state)
            balances[effect.name] = rate - effect.rate(p, signals, state)
    return total


def grip_of(parts: tuple[Part, ...], p: Values, signals: PortSignals) -> Grip:
    """The rail's grip in both directions [N]: the sum of all shares."""
    up, down = jnp.zeros_like(signals.load), jnp.zeros_like(signals.load)
    for effect, _, _ in parts:
        if isinstance(effect, AbstractGrip):
            share = effect.grip(p, signals)
            up, down = up + share.against_up, down + share.against_down
    return Grip(up, down)


def true_road(parts: tuple[Part, ...], p: Values, inputs: Inputs) -> Road:
    """What the plate does, all errors of the recorded road added."""
    height, velocity = inputs.road
    cam = inputs.cam or Cam(jnp.zeros_like(height), jnp.zeros_like(height))
    for effect, _, _ in parts:
        if isinstance(effect, AbstractRoadFault):
            shift = effect.shift(p, inputs.road, cam)
            height, velocity = height + shift.height, velocity + shift.velocity
    return Road(height, velocity)
