"""Damped Newton iteration on all dwells at once.

Each dwell has its own damping: where a step is longer than the one before it (a friction that sticks now
here, now there), the next ones are shortened; where steps shrink they are taken whole again.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.tree_util import PyTreeDef
from jaxtyping import Array, Float, Int

from savgs_ident.core.values import Values
from savgs_ident.effects.base import InputSignal
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.collocation import (
    Linearised,
    Trajectory,
    blank_linearised,
    linearise,
    solve_linearised,
    step_defects,
)
from savgs_ident.simulate.cyclic import CyclicFactors
from savgs_ident.simulate.mesh import Layout

TOLERANCE = 1e-7
"""Largest last Newton step, relative to the size of the motion: the error left is far smaller."""

TRUST = 0.5
"""Longest step taken at a time, relative to the size of the motion."""

LEAST_SHARE = 1.0 / 8.0
"""The strongest damping."""


class NewtonResult(NamedTuple):
    """A trajectory, its linearisation, the last relative step of each dwell [1], (D,), and iterations used."""

    trajectory: Trajectory
    linearised: Linearised
    last_step: Float[Array, " D"]
    iterations: Int[Array, ""]


def newton_structure() -> PyTreeDef:
    """How the arrays of a result belong together."""
    zero = jnp.zeros(())
    factors = CyclicFactors(zero, zero, zero)
    result = NewtonResult(Trajectory(zero, zero), Linearised(zero, zero, zero, zero, factors), zero, zero)
    return jax.tree.structure(result)


class _Progress(NamedTuple):
    result: NewtonResult
    share: Float[Array, " D"]


def motion_scale(
    model: AbstractPlant, signals: tuple[InputSignal, ...], frequency: Float[Array, " D"], layout: Layout
) -> Float[Array, "m P"]:
    """A typical size of every state [its unit] at the dwells' frequencies [Hz], from the amplitudes of the inputs."""
    amplitudes = [_amplitude(each.value, layout) for each in signals]
    sizes = [
        sum(given.moves[i] * amplitude for given, amplitude in zip(model.inputs, amplitudes, strict=True))
        for i in range(len(model.coordinates))
    ]
    rates = [2.0 * jnp.pi * frequency * size for size in sizes]
    states = [jnp.full_like(frequency, state.scale) for state in model.states]
    return jnp.stack([*sizes, *rates, *states])[:, layout.dwell]


def _over_dwells(values: Float[Array, " P"], layout: Layout) -> Float[Array, " D"]:
    """The largest value in each dwell; NaN where one is NaN."""
    finite = jnp.where(jnp.isnan(values), jnp.inf, values)
    return jax.ops.segment_max(finite, layout.dwell, len(layout.counts), indices_are_sorted=True)


def _amplitude(values: Float[Array, " P"], layout: Layout) -> Float[Array, " D"]:
    return (_over_dwells(values, layout) + _over_dwells(-values, layout)) / 2.0


def _rates(model: AbstractPlant, at: Trajectory) -> Array:
    """xd = (qd, y), (m, P), in SI per second."""
    n = len(model.coordinates)
    return jnp.concatenate([at.x[n : 2 * n], at.y])


def _newton_step(
    model: AbstractPlant, p: Values, at: Trajectory, u: Any, layout: Layout, steps: Array
) -> tuple[Trajectory, Linearised]:
    lin = linearise(model, p, at, u, layout, steps)
    rate = _rates(model, at).at[len(model.coordinates) :].add(lin.imbalance)
    return solve_linearised(layout, lin, step_defects(model, at, rate, layout, steps), lin.imbalance), lin


def solve_newton(
    model: AbstractPlant,
    p: Values,
    start: Trajectory,
    u: Any,
    layout: Layout,
    steps: Float[Array, " P"],
    scale: Float[Array, "m P"],
    limit: Int[Array, ""],
    enough: Float[Array, ""],
) -> NewtonResult:
    """Iterate until every dwell's step is below ``enough`` or ``limit`` iterations are used.

    ``steps`` [s] lead from node to node, ``scale`` is the size of each state [its unit]; a step counts
    relative to it [1].
    """

    def advance(progress: _Progress) -> _Progress:
        before = progress.result
        at = before.trajectory
        change, lin = _newton_step(model, p, at, u, layout, steps)
        length = _over_dwells(jnp.max(jnp.abs(change.x) / scale, axis=0), layout)
        damped = jnp.maximum(progress.share / 2.0, LEAST_SHARE)
        share = jnp.where(length > before.last_step, damped, jnp.minimum(1.0, 2.0 * progress.share))
        taken = jnp.minimum(share, TRUST / length)[layout.dwell]
        moved = Trajectory(at.x + taken * change.x, at.y + taken * change.y)
        return _Progress(NewtonResult(moved, lin, length, before.iterations + 1), share)

    def unfinished(progress: _Progress) -> Array:
        step = progress.result.last_step
        return jnp.any(step > enough) & jnp.all(jnp.isfinite(step)) & (progress.result.iterations < limit)

    blank = blank_linearised(model, layout)
    far = jnp.full(len(layout.counts), np.finfo(np.float64).max)
    begin = _Progress(NewtonResult(start, blank, far, jnp.array(0)), jnp.ones_like(far))
    return jax.lax.while_loop(unfinished, advance, begin).result
