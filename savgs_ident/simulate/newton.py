"""Damped Newton iteration on all dwells at once.

Each dwell has its own damping: where a step is longer than the one before it (a friction that sticks now
here, now there), the next ones are shortened; where steps shrink they are taken whole again.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from savgs_ident.model.kinematics import Values
from savgs_ident.model.quarter_car import Inputs, QuarterCar
from savgs_ident.simulate.collocation import (
    Linearised,
    Trajectory,
    linearise,
    solve_linearised,
    step_defects,
)

TOLERANCE = 1e-7
"""Largest last Newton step, relative to the size of the motion: the error left is far smaller."""

TRUST = 0.5
"""Longest step taken at a time, relative to the size of the motion."""

LEAST_SHARE = 1.0 / 8.0
"""The strongest damping."""


class NewtonResult(NamedTuple):
    """A trajectory, its linearisation, the last relative step of each dwell (D,), and iterations used."""

    trajectory: Trajectory
    linearised: Linearised
    last_step: Float[Array, " D"]
    iterations: Int[Array, ""]


class _Progress(NamedTuple):
    result: NewtonResult
    share: Float[Array, " D"]


def motion_scale(model: QuarterCar, inputs: Inputs, frequency: Float[Array, " D"]) -> Float[Array, "m D 1"]:
    """A typical size of every state: that of the road's motion, seen over an arm of a third of a metre."""
    lift = (jnp.max(inputs.road.height, axis=-1) - jnp.min(inputs.road.height, axis=-1)) / 2.0
    speed = 2.0 * jnp.pi * frequency * lift
    states = [jnp.full_like(lift, state.scale) for state in model.states]
    return jnp.stack([lift, 3.0 * lift, speed, 3.0 * speed, *states])[:, :, None]


def rates_of(at: Trajectory) -> Array:
    """xd = (velocities, y)."""
    return jnp.concatenate([at.x[2:4], at.y])


def _newton_step(
    model: QuarterCar, p: Values, at: Trajectory, inputs: Inputs, steps: Array
) -> tuple[Trajectory, Linearised]:
    lin = linearise(model, p, at, inputs, steps)
    rate = rates_of(at).at[2:].add(lin.imbalance)
    return solve_linearised(model, lin, step_defects(model, at, rate, steps), lin.imbalance), lin


def solve_newton(
    model: QuarterCar,
    p: Values,
    start: Trajectory,
    inputs: Inputs,
    steps: Float[Array, "D N"],
    scale: Float[Array, "m D 1"],
    limit: int,
) -> NewtonResult:
    """Iterate until every dwell's step is below :data:`TOLERANCE` or ``limit`` iterations are used."""

    def advance(progress: _Progress) -> _Progress:
        before = progress.result
        at = before.trajectory
        change, lin = _newton_step(model, p, at, inputs, steps)
        length = jnp.max(jnp.abs(change.x) / scale, axis=(0, 2))
        damped = jnp.maximum(progress.share / 2.0, LEAST_SHARE)
        share = jnp.where(length > before.last_step, damped, jnp.minimum(1.0, 2.0 * progress.share))
        taken = jnp.minimum(share, TRUST / length)[:, None]
        moved = Trajectory(at.x + taken * change.x, at.y + taken * change.y)
        return _Progress(NewtonResult(moved, lin, length, before.iterations + 1), share)

    def unfinished(progress: _Progress) -> Array:
        step = progress.result.last_step
        return jnp.any(step > TOLERANCE) & jnp.all(jnp.isfinite(step)) & (progress.result.iterations < limit)

    shape = jax.eval_shape(lambda: linearise(model, p, start, inputs, steps))
    blank = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)
    far = jnp.full(start.x.shape[1], jnp.finfo(jnp.float64).max)
    begin = _Progress(NewtonResult(start, blank, far, jnp.array(0)), jnp.ones_like(far))
    return jax.lax.while_loop(unfinished, advance, begin).result
