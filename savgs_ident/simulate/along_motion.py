"""The force that a plant needs from its drive along a measured motion.

The motion is imposed on a plant with one coordinate and one input, the force of its drive. Where the residual
r(q, qd, qdd, s, sd, u; p) of the equation of motion does not vanish, the drive would have had to exert

    u - r / (dr/du)

instead of the recorded u; dr/du does not depend on u. Internal states of effects (the anchor of a contact that
sticks) are marched along the motion from rest, by backward Euler where they slip and nearly by the trapezoidal rule
elsewhere.
"""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.small_root import solve_dense
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Fundamental, InputSignal
from savgs_ident.effects.composition import nothing_imposed
from savgs_ident.plants.base import AbstractPlant, AtPorts, Motion

FORWARD = 0.52
"""Weight of the far end of a step for states that do not slip: hardly any damping, and none that rings on."""

NEWTON_STEPS = 4
"""Steps to the state of the next instant."""


class Samples(NamedTuple):
    """The measured motion at n even samples: q, qd, qdd, force of the drive and its rate, angle of the cycle; SI."""

    q: Float[Array, " n"]
    qd: Float[Array, " n"]
    qdd: Float[Array, " n"]
    drive: Float[Array, " n"]
    drive_rate: Float[Array, " n"]
    angle: Float[Array, " n"]
    speed: Float[Array, " n"]


class Course(NamedTuple):
    """Internal states and their rates along a motion, (n, s) each, and the Newton step that was left, (n,) [1]."""

    state: Float[Array, "n s"]
    rate: Float[Array, "n s"]
    step_left: Float[Array, " n"]


class Needed(NamedTuple):
    """Force needed from the drive [N] at the samples, (n,), and the largest Newton step left in a state [1]."""

    force: Float[Array, " n"]
    step_left: Float[Array, ""]


def _at(model: AbstractPlant, now: Samples) -> tuple[Motion, tuple[InputSignal], Fundamental]:
    motion = Motion(*(model.coordinate_type(each) for each in (now.q, now.qd, now.qdd)))
    return motion, (InputSignal(now.drive, now.drive_rate),), Fundamental(now.angle, now.speed)


def _march(model: AbstractPlant, p: Values, along: Samples, step: float) -> Course:
    """The states of the effects along a motion, from rest."""
    size, n = len(model.states), len(model.coordinates)
    scale = jnp.asarray([each.scale for each in model.states])
    weight = jnp.asarray([1.0 if each.slips else FORWARD for each in model.states])
    known = jax.lax.stop_gradient(p)

    def advance(before: Array, at: Samples) -> tuple[Array, Course]:
        motion, signals, fundamental = _at(model, at)
        u = model.drive(signals, fundamental)

        def parts(now: Array, before: Array) -> tuple[Array, Array]:
            return weight * now + (1.0 - weight) * before, (now - before) / step

        def defect(p: Values, now: Array, before: Array) -> Array:
            return model.residual(p, motion, *parts(now, before), u)[n:]

        def jacobian(now: Array) -> Array:
            columns = [
                jax.jvp(lambda each: defect(known, each, held), (now,), (unit,))[1]
                for unit in jnp.unstack(jnp.eye(size))
            ]
            return jnp.stack(columns, axis=1)

        def correction(now: Array) -> Array:
            return solve_dense(jacobian(now), defect(known, now, held))

        # The last step alone is differentiated: its slopes are those of the implicit function theorem.
        held = jax.lax.stop_gradient(before)
        near = jax.lax.fori_loop(0, NEWTON_STEPS - 1, lambda _, each: each - correction(each), held)
        now = near - solve_dense(jacobian(near), defect(p, near, before))
        left = jnp.max(jnp.abs(correction(jax.lax.stop_gradient(now))) / scale)
        return now, Course(*parts(now, before), left)

    if size == 0:
        none = jnp.zeros((along.q.size, 0))
        return Course(none, none, jnp.zeros(along.q.size))
    return jax.lax.scan(advance, jnp.zeros(size), along)[1]


def _needed(
    model: AbstractPlant, p: Values, along: Samples, step: float, imposed: Mapping[str, Array]
) -> Needed:
    """What the drive would have had to exert, with signals (n,) or (n, 2) ``imposed`` at ports [SI]."""
    course = _march(model, p, along, step)

    def at(now: Samples, s: Array, sd: Array, imposed: Mapping[str, Array]) -> Array:
        motion, (recorded,), fundamental = _at(model, now)

        def out_of_balance(drive: Array) -> Array:
            u = model.drive((recorded._replace(value=drive),), fundamental, imposed)
            return model.residual(p, motion, s, sd, u)[0]

        r, slope = jax.jvp(out_of_balance, (now.drive,), (jnp.ones_like(now.drive),))
        return now.drive - r / slope

    force = jax.vmap(at)(along, course.state, course.rate, dict(imposed))
    return Needed(force, jnp.max(course.step_left))


@eqx.filter_jit
def needed_force(model: AbstractPlant, p: Values, along: Samples, step: float) -> Needed:
    """What the drive would have had to exert, and whether the states were found."""
    return _needed(model, p, along, step, nothing_imposed(model.ports, along.q))


@eqx.filter_jit
def force_slopes(
    model: AbstractPlant, p: Values, along: Samples, step: float, directions: Mapping[str, Float[Array, " k"]]
) -> Float[Array, "k n"]:
    """Slopes of the force along k directions of the parameters."""
    blank = nothing_imposed(model.ports, along.q)

    def of(p: Values) -> Array:
        return _needed(model, p, along, step, blank).force

    return jax.vmap(lambda direction: jax.jvp(of, (dict(p),), (direction,))[1])(dict(directions))


@eqx.filter_jit
def force_gain(model: AbstractPlant, p: Values, along: Samples, step: float, port: str) -> Float[Array, " n"]:
    """Change of the needed force per unit of a signal imposed at a port [N per the port's unit], (n,)."""
    blank = nothing_imposed(model.ports, along.q)
    unit = jnp.zeros_like(blank[port])
    unit = unit.at[:, 0].set(1.0) if unit.ndim == 2 else jnp.ones_like(unit)

    def of(signal: Array) -> Array:
        return _needed(model, p, along, step, blank | {port: signal}).force

    return jax.jvp(of, (blank[port],), (unit,))[1]


@eqx.filter_jit
def ports_along(model: AbstractPlant, p: Values, along: Samples, step: float) -> AtPorts:
    """What laws see at the ports at every sample, (n,) each."""
    course = _march(model, p, along, step)

    def at(now: Samples, s: Array, sd: Array) -> AtPorts:
        motion, signals, fundamental = _at(model, now)
        return model.at_ports(p, motion, s, sd, model.drive(signals, fundamental))

    return jax.vmap(at)(along, course.state, course.rate)
