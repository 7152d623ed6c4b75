"""What an effect would do to the response, to first order at its null, without a model that has it.

An effect without states is in the model already, at its null: its sensitivities are derivatives of the response. An
effect with states is marched along the port signals of the motion as it is until it repeats, at a typical size;
what it would do at its port is then imposed on the linearised rig.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.executor import in_parallel
from savgs_ident.core.small_root import jacobian, solve_dense
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractSeriesLaw,
    Bristle,
    Load,
    Port,
    PortKind,
    PortSignals,
)
from savgs_ident.effects.composition import contact_bristle
from savgs_ident.effects.effect import Effect
from savgs_ident.inference.background.imposed import impose, node_loads
from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.inference.observations import Term
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.along_motion import FORWARD, NEWTON_STEPS
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import placed

SAMPLES = 384
"""Instants of a period along which states are marched."""

PERIODS = 16
"""Periods after which they repeat: what rang at the start has died away even in a slow, slightly damped frame."""


def sensitivities_with_states(
    model: AbstractPlant,
    likelihood: Likelihood,
    orders: int,
    p: Values,
    solution: PeriodicSolution,
    effects: Sequence[Effect],
    typical: Sequence[Mapping[str, float]],
) -> NDArray[np.float64]:
    """Change of the rows by each effect at its ``typical`` parameters, (effects, m).

    Rows are in the units of their readings, ``typical`` in SI.
    """
    signals, steps = _evenly(model, p, solution)

    def field(one: tuple[Effect, Mapping[str, float]]) -> tuple[str, NDArray[np.float64]]:
        effect, given = one
        along = np.asarray(_marched(effect, placed(dict(p) | as_values(given)), signals, steps))
        return effect.port.name, _at_nodes(along, solution)

    fields = in_parallel(field, zip(effects, typical, strict=True))
    return impose(model, likelihood, orders, p, solution, fields)


def secants_of_terms(
    model: AbstractPlant,
    likelihood: Likelihood,
    orders: int,
    p: Values,
    solution: PeriodicSolution,
    effects: Sequence[Effect],
    terms: Sequence[Term],
    size: float,
) -> dict[str, NDArray[np.float64]]:
    """Change of the rows per unit of the amplitude of every term whose effect has states, by name, (tries, m, 1).

    They are secants to the typical sizes, ``size`` scales from the centres.
    """
    every, typical = [], []
    for term, effect in zip(terms, effects, strict=True):
        there = {each.name: each.centre + size * each.scale for each in term.amplitudes}
        every += [effect] * len(term.tried)
        typical += [there | shapes for shapes in term.tried]
    moved = iter(sensitivities_with_states(model, likelihood, orders, p, solution, every, typical))
    return {
        term.name: np.stack([next(moved)[:, None] for _ in term.tried]) / (size * term.amplitudes[0].scale)
        for term in terms
    }


def rehearse(p: Values, effects: Sequence[Effect], tests: int) -> None:
    """Have compiled what marches effects with states, on a rig that stands still: nothing else must wait for it."""
    still = jnp.zeros((tests, SAMPLES))
    steps = np.full(tests, 1.0 / SAMPLES)
    for effect in effects:
        gives = effect.port.kind is PortKind.SERIES
        seen = Load(still, still) if gives else PortSignals(still, still, still, still)
        _marched(effect, placed(dict(p)), {effect.port.name: seen}, steps)


def marched_effect(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, effect: Effect
) -> NDArray[np.float64]:
    """What an effect with states does at its port along a motion.

    A force (P,) [N], or a way and its rate (P, 2).
    """
    signals, steps = _evenly(model, p, solution)
    return _at_nodes(np.asarray(_marched(effect, placed(dict(p)), signals, steps)), solution)


def marched_contact(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, effect: Effect
) -> NDArray[np.float64]:
    """Friction [N] of the contact at the port of an effect along a motion of ``model``, (P,).

    Under the friction limits of the effect and of the model at ``p``. The bristle's anchor is marched: it is not that
    of the motion, which has limits of its own.
    """
    signals, steps = _evenly(model, p, solution)
    sliding = signals[effect.port.name]
    assert isinstance(sliding, PortSignals)
    others = tuple(each for each in model.effects if each.loads_contact and each.name != effect.name)
    marched = _march_contact((*others, effect), effect.port, placed(dict(p)), sliding, jnp.asarray(steps))
    return _at_nodes(np.asarray(marched), solution)


def _evenly(
    model: AbstractPlant, p: Values, solution: PeriodicSolution
) -> tuple[dict[str, PortSignals | Load], NDArray[np.float64]]:
    """Port signals, or loads as those of a series element, (D, SAMPLES) each, and the time steps [s], (D,)."""
    ports, carried = node_loads(model, p, solution)
    layout, phase = solution.mesh.layout, np.asarray(solution.mesh.phase)
    grid = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES

    def even(values: Array) -> Array:
        flat = np.asarray(values)
        rows = [
            np.interp(grid, phase[layout.dwell == dwell], flat[layout.dwell == dwell], period=2.0 * np.pi)
            for dwell in range(len(layout.counts))
        ]
        return jnp.asarray(np.stack(rows))

    signals: dict[str, PortSignals | Load] = {
        name: PortSignals(*(even(part) for part in each)) for name, each in ports.items()
    }
    for name, load in carried.items():
        signals[name] = Load(even(load.total), even(load.rest))
    return signals, 1.0 / (SAMPLES * np.asarray(solution.excitation.frequency))


def _marched(
    effect: Effect,
    p: Values,
    signals: Mapping[str, PortSignals | Load],
    steps: NDArray[np.float64],
) -> Float[Array, "D n k"]:
    """What the effect does at its port along the last period: a force, or a way and its rate."""
    return _march(effect, p, signals[effect.port.name], jnp.asarray(steps))


@eqx.filter_jit
def _march(
    effect: Effect, p: Values, signals: PortSignals | Load, steps: Float[Array, " D"]
) -> Float[Array, "D n k"]:
    weight = jnp.asarray([1.0 if state.slips else FORWARD for state in effect.states])

    def defect(now: Array, before: Array, at: Any, step: Array) -> Array:
        rate, state = (now - before) / step, weight * now + (1.0 - weight) * before
        if isinstance(effect.law, AbstractSeriesLaw):
            return effect.balance(p, at, state, rate)
        return rate - effect.rate(p, at, state)

    def output(now: Array, before: Array, at: Any, step: Array) -> Array:
        if isinstance(effect.law, AbstractForceLaw):
            return effect.force(p, at, now)[None]
        return jnp.stack([now[0], (now[0] - before[0]) / step])

    # A step ends at an instant, and sees the port as it is on the way there.
    signals = jax.tree.map(
        lambda each: each + (1.0 - weight[0]) * (jnp.roll(each, 1, axis=1) - each), signals
    )
    return _repeat(defect, output, weight.size, signals, steps)


@eqx.filter_jit
def _march_contact(
    effects: tuple[Effect, ...], port: Port, p: Values, signals: PortSignals, steps: Float[Array, " D"]
) -> Float[Array, "D n 1"]:
    def held(now: Array, at: PortSignals) -> Bristle:
        return contact_bristle(effects, port, p, at, now[0])

    def defect(now: Array, before: Array, at: PortSignals, step: Array) -> Array:
        return (now - before) / step - held(now, at).rate

    def output(now: Array, before: Array, at: PortSignals, step: Array) -> Array:
        del before, step
        return held(now, at).force[None]

    return _repeat(defect, output, 1, signals, steps)


def _repeat(
    defect: Callable[..., Array],
    output: Callable[..., Array],
    size: int,
    signals: Any,
    steps: Float[Array, " D"],
) -> Float[Array, "D n k"]:
    """``output`` along the last of several periods; ``defect`` vanishes for the state at the end of a step."""

    def one_dwell(signals: Any, step: Array) -> Array:
        def advance(before: Array, at: Any) -> tuple[Array, Array]:
            def better(_: Array, now: Array) -> Array:
                left, matrix = jacobian(lambda each: defect(each, before, at, step), now)
                return now - solve_dense(matrix, left)

            now = jax.lax.fori_loop(0, NEWTON_STEPS, better, before)
            return now, output(now, before, at, step)

        def period(begun: Array, _: None) -> tuple[Array, Array]:
            return jax.lax.scan(advance, begun, signals)

        # All periods are kept and the last is taken: apart from the others it would be compiled once more.
        periods: Array = jax.lax.scan(period, jnp.zeros(size), length=PERIODS)[1]
        return periods[-1]

    return jax.vmap(one_dwell)(signals, steps)


def _at_nodes(along: NDArray[np.float64], solution: PeriodicSolution) -> NDArray[np.float64]:
    """(D, SAMPLES, k) on the nodes: (P,) for a force, (P, 2) for a way."""
    layout, phase = solution.mesh.layout, np.asarray(solution.mesh.phase)
    grid = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    out = np.zeros((layout.total, along.shape[2]))
    for dwell in range(len(layout.counts)):
        mine = layout.dwell == dwell
        for k in range(along.shape[2]):
            out[mine, k] = np.interp(phase[mine], grid, along[dwell, :, k], period=2.0 * np.pi)
    return out[:, 0] if along.shape[2] == 1 else out
