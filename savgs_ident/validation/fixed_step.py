"""Motions of the rig by a fixed step: the classical method of Runge and Kutta.

Truth of foreign trials comes from here: neither the collocation of the diagnosis nor the error-controlled integration
of other virtual campaigns. The accelerations at every stage are the root of the plant's residual.

Source: Kutta 1901, Zeitschrift fuer Mathematik und Physik 46.
"""

from math import ceil

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractPlant, AbstractSource, Motion, nominal_readings
from savgs_ident.simulate.program_cache import placed
from savgs_ident.simulate.transient import PlantState, pack_state, state_rates, unpack_state

State = Float[Array, " x"]


def substeps_for(duration: float, samples: int, step: float) -> int:
    """Steps from one of the ``samples`` of a ``duration`` [s] to the next, none longer than ``step`` [s]."""
    return max(1, ceil(duration / samples / step))


def integrate_fixed(
    model: AbstractPlant,
    p: Values,
    start: State,
    source: AbstractSource,
    duration: float,
    samples: int,
    step: float,
) -> tuple[State, Float[Array, "C n"]]:
    """The packed state after a ``duration`` [s], and the readings at the n ``samples`` that begin it, in SI.

    No step is longer than ``step`` [s]; no number is finite where there is no motion.
    """
    inner = substeps_for(duration, samples, step)
    interval, steps = placed((jnp.asarray(duration / samples), jnp.asarray(inner)))
    return _integrated(model, p, start, source, interval, steps, samples)


@eqx.filter_jit
def _integrated(
    model: AbstractPlant,
    p: Values,
    start: State,
    source: AbstractSource,
    interval: Array,
    inner: Array,
    samples: int,
) -> tuple[State, Array]:
    prepared, size = model.prepare(p), len(model.coordinates)
    zeros, h = nominal_readings(model, p, prepared), interval / inner.astype(interval.dtype)

    def rate(t: Array, x: State, near: Array) -> tuple[State, Array]:
        """Rates of the packed state, and the accelerations and rates from which the next are found sooner."""
        now = state_rates(model, p, source, t, unpack_state(model, x), prepared, near)
        return pack_state(now), jnp.concatenate([pack_state(now)[size : 2 * size], now.s])

    def advance(t: Array, x: State, near: Array) -> tuple[State, Array]:
        k1, near = rate(t, x, near)
        k2, near = rate(t + h / 2.0, x + h / 2.0 * k1, near)
        k3, near = rate(t + h / 2.0, x + h / 2.0 * k2, near)
        k4, near = rate(t + h, x + h * k3, near)
        return x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), near

    def sample(carried: tuple[State, Array], i: Array) -> tuple[tuple[State, Array], Array]:
        t = i * interval
        near = rate(t, *carried)[1]
        shown = _readings(model, p, source, t, unpack_state(model, carried[0]), near, prepared)
        steps = (carried[0], near)
        end = jax.lax.fori_loop(0, inner, lambda k, at: advance(t + k.astype(h.dtype) * h, *at), steps)
        return end, shown - jnp.stack(zeros)

    guess = jnp.zeros(size + len(model.states))
    (end, _), readings = jax.lax.scan(sample, (start, guess), jnp.arange(samples, dtype=jnp.float64))
    return end, readings.T


def _readings(
    model: AbstractPlant,
    p: Values,
    source: AbstractSource,
    t: Array,
    now: PlantState,
    rates: Array,
    prepared: object,
) -> Float[Array, " C"]:
    """What the sensors show if none has dynamics; ``rates`` are accelerations and rates of internal states."""
    size = len(model.coordinates)
    motion = Motion(now.q, now.qd, model.coordinate_type(*jnp.unstack(rates[:size])))
    u = source.inputs(model, t, now.source)
    return jnp.stack(model.read(p, motion, now.s, rates[size:], u, prepared))
