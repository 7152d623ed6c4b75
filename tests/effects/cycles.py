"""Periodic motions and loads of a port, and the states of a mechanism along them.

The states are marched by backward Euler, which is stable for every rate there may be, until they repeat: so they
are where they come to in use, sticking and sliding, and the energy of a cycle is that of the mechanism alone. The
rail's friction limits are marched through the bristle that they load, all effects but rail friction on top of it.
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.small_root import solve_dense
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractFrictionLimitLaw,
    AbstractSeriesLaw,
    FrictionLimit,
    Load,
    PortSignals,
    Presliding,
    bristle,
)
from savgs_ident.effects.composition import states_of
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, build_model
from savgs_ident.plants.quarter_car.ports import (
    CARCASS,
    DAMPER,
    FRAME,
    LINK,
    MOUNT,
    PLATE,
    STRUT,
    TYRE_LATERAL,
    TYRE_RADIAL,
)
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig

NODES, PERIODS, FREQUENCY = 1024, 20, 1.7
STEP = 1.0 / (FREQUENCY * NODES)

CENTRE = {STRUT: 0.45, TYRE_RADIAL: 0.013, TYRE_LATERAL: 0.65}
"""About where a port's displacement is [m]; elsewhere zero."""

CARRIED = {
    MOUNT: (5300.0, 3000.0),
    DAMPER: (0.0, 3000.0),
    LINK: (-57.0, 80.0),
    PLATE: (3600.0, 2500.0),
    CARCASS: (0.0, 500.0),
    FRAME: (-3600.0, 2500.0),
}
"""Load at rest and by how much it changes, where something may give way [N or N m]."""


@dataclass(frozen=True)
class Cycle:
    """A cycle of a mechanism, at NODES instants.

    ``drive`` is the displacement, velocity, load and rest of a port (n, 4), or for what gives way its load and that
    at rest (n, 2); ``state`` and ``rate`` are (n, s), the bristle's anchor for a limit. ``power`` [W] is what the
    mechanism takes from the rig; ``open`` is by how much the states do not repeat, relative to their scale.
    """

    drive: NDArray[np.float64]
    state: NDArray[np.float64]
    rate: NDArray[np.float64]
    power: NDArray[np.float64]
    open: float


def _waves(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A periodic quantity of height 1, and its rate, (n,)."""
    rng = np.random.default_rng(seed)
    phase, order = 2.0 * np.pi * np.arange(NODES) / NODES, np.arange(1, 4)[:, None]
    turned = np.exp(1j * (order * phase + rng.uniform(0, 6.3, (3, 1))))
    waves = rng.standard_normal((3, 1)) / order**2 * turned
    value, rate = np.sum(waves.real, axis=0), np.sum((1j * order * waves).real, axis=0)
    highest = np.max(np.abs(value))
    return value / highest, rate * 2.0 * np.pi * FREQUENCY / highest


def _drive(effect: Effect, p: Values, seed: int) -> NDArray[np.float64]:
    value, rate = _waves(seed)
    if isinstance(effect.law, AbstractSeriesLaw):
        rest, size = CARRIED[effect.port]
        return np.column_stack([rest + size * value, np.full(NODES, rest)])
    displacement, velocity = CENTRE.get(effect.port, 0.0) + 0.01 * value, 0.01 * rate
    if effect.port == STRUT:
        damper = build_model(read_rig(default_rig_path()), ()).damper
        load = np.asarray(p["c_sd"] * jax.vmap(damper)(-velocity))
    else:
        load = 3000.0 * (1.0 + 0.8 * _waves(seed + 100)[0])
    return np.column_stack([displacement, velocity, load, np.full(NODES, CENTRE.get(effect.port, 0.0))])


def _held(effect: Effect, p: Values, signals: PortSignals) -> FrictionLimit:
    """The rail's friction and what the effect makes of it."""
    both = {each.name: each for each in (CATALOGUE["rail_coulomb"], effect)}
    shares = [each.friction_limit(p, signals) for each in both.values()]
    return FrictionLimit(*(sum(each[way] for each in shares) for way in (0, 1)))


def _balance(effect: Effect, p: Values, drive: Array, state: Array, rate: Array) -> Array:
    """What vanishes for the right rates."""
    if isinstance(effect.law, AbstractSeriesLaw):
        return effect.balance(p, Load(*jnp.unstack(drive)), state, rate)
    signals = PortSignals(*jnp.unstack(drive))
    if isinstance(effect.law, AbstractFrictionLimitLaw):
        held = bristle(Presliding(p["k_pre"], p["c_pre"]), signals, _held(effect, p, signals), state[0])
        return rate - held.rate
    return rate - effect.rate(p, signals, state)


def _power(effect: Effect, p: Values, drive: Array, state: Array, rate: Array) -> Array:
    """Power [W] that the mechanism takes.

    At the strut the load is itself a force at the port, the damper's push: a force that depends on it is one with
    the damper.
    """
    if isinstance(effect.law, AbstractSeriesLaw):
        return drive[0] * rate[0]
    signals = PortSignals(*jnp.unstack(drive))
    if isinstance(effect.law, AbstractFrictionLimitLaw):
        held = bristle(Presliding(p["k_pre"], p["c_pre"]), signals, _held(effect, p, signals), state[0])
        return -held.force * signals.velocity
    force = effect.force(p, signals, state)
    if effect.port == STRUT:
        unloaded = effect.force(p, signals._replace(load=jnp.zeros_like(signals.load)), state)
        force = force + jnp.where(force == unloaded, 0.0, signals.load)
    return -effect.port.sense * force * signals.velocity


@eqx.filter_jit
def _march(effect: Effect, p: Values, drive: Array, start: Array) -> tuple[Array, Array, Array]:
    """States, rates and powers along a cycle (n, ...), and the states at its end."""

    def advance(before: Array, at: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        def defect(now: Array) -> Array:
            return _balance(effect, p, at, now, (now - before) / STEP)

        now = before
        for _ in range(4):
            columns = [jax.jvp(defect, (now,), (unit,))[1] for unit in jnp.unstack(jnp.eye(now.size))]
            now = now - solve_dense(jnp.stack(columns, axis=1), defect(now))
        rate = (now - before) / STEP
        return now, (now, rate, _power(effect, p, at, now, rate))

    return jax.lax.scan(advance, start, drive)[1]


@eqx.filter_jit
def _powers(effect: Effect, p: Values, drive: Array) -> Array:
    """Of a mechanism without states, (n,)."""
    return jax.vmap(lambda at: _power(effect, p, at, jnp.zeros(0), jnp.zeros(0)))(drive)


def along_a_cycle(effect: Effect, p: Values, seed: int) -> Cycle:
    """A mechanism along a random cycle."""
    drive = _drive(effect, p, seed)
    states = states_of((effect,))
    if not states:
        none = np.zeros((NODES, 0))
        return Cycle(drive, none, none, np.asarray(_powers(effect, p, jnp.asarray(drive))), 0.0)
    begin, end = np.zeros(len(states)), np.zeros(len(states))
    for _ in range(PERIODS):
        begin = end
        state, rate, power = (np.asarray(each) for each in _march(effect, p, jnp.asarray(drive), begin))
        end = state[-1]
    scale = np.array([each.scale for each in states])
    return Cycle(drive, state, rate, power, float(np.max(np.abs(end - begin) / scale)))
