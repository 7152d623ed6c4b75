"""The force that a plant needs from its drive along a measured motion.

The motion is imposed on a plant with one coordinate whose first input is the force of its drive. Where the residual
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

from savgs_ident.core.small_root import jacobian, solve_dense
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Fundamental, InputSignal
from savgs_ident.effects.composition import nothing_imposed
from savgs_ident.plants.base import AbstractPlant, AtPorts, Motion
from savgs_ident.simulate.sensitivity import along_first

FORWARD = 0.52
"""Weight of the far end of a step for states that do not slip: hardly any damping, and none that rings on."""

NEWTON_STEPS = 4
"""Steps to the state of the next instant."""


class Samples(NamedTuple):
    """The measured motion at n even samples: q, qd, qdd, force of the drive and its rate, angle of the cycle; SI.

    ``begins`` is 1 where a test begins and 0 elsewhere: there the states are at rest. ``beside`` are the plant's
    other inputs, as a current is.
    """

    q: Float[Array, " n"]
    qd: Float[Array, " n"]
    qdd: Float[Array, " n"]
    drive: Float[Array, " n"]
    drive_rate: Float[Array, " n"]
    angle: Float[Array, " n"]
    speed: Float[Array, " n"]
    begins: Float[Array, " n"]
    beside: tuple[InputSignal, ...] = ()


class Course(NamedTuple):
    """Internal states and their rates along a motion, (n, s) each."""

    state: Float[Array, "n s"]
    rate: Float[Array, "n s"]


class Needed(NamedTuple):
    """Force needed from the drive [N] at the samples, (n,), and the largest Newton step left in a state [1]."""

    force: Float[Array, " n"]
    step_left: Float[Array, ""]


class NeededSlopes(NamedTuple):
    """Force needed from the drive, and its slopes along k directions of the parameters [N per unit]."""

    needed: Needed
    slopes: Float[Array, "k n"]


def _at(model: AbstractPlant, now: Samples) -> tuple[Motion, tuple[InputSignal, ...], Fundamental]:
    motion = Motion(*(model.coordinate_type(each) for each in (now.q, now.qd, now.qdd)))
    signals = (InputSignal(now.drive, now.drive_rate), *now.beside)
    return motion, signals, Fundamental(now.angle, now.speed)


def _weights(model: AbstractPlant) -> Float[Array, " s"]:
    """Weight of the far end of a step in each state of the effects [1]."""
    return jnp.asarray([1.0 if each.slips else FORWARD for each in model.states])


def _defect(
    model: AbstractPlant, p: Values, at: Samples, step: float, now: Array, before: Array
) -> Float[Array, " s"]:
    """What the equations of the states leave over a step that ends at a sample [their units]."""
    motion, signals, fundamental = _at(model, at)
    weight = _weights(model)
    state, rate = weight * now + (1.0 - weight) * before, (now - before) / step
    return model.residual(p, motion, state, rate, model.drive(signals, fundamental))[len(model.coordinates) :]


def _march(
    model: AbstractPlant, p: Values, along: Samples, step: float
) -> tuple[Float[Array, "n s"], Float[Array, " n"]]:
    """The states of the effects at the samples of a motion, from rest, and the Newton step that was left [1]."""
    size = len(model.states)
    if size == 0:
        return jnp.zeros((along.q.size, 0)), jnp.zeros(along.q.size)
    scale = jnp.asarray([each.scale for each in model.states])

    def advance(before: Array, at: Samples) -> tuple[Array, tuple[Array, Array]]:
        before = (1.0 - at.begins) * before

        def defect(now: Array) -> Array:
            return _defect(model, p, at, step, now, before)

        def correction(now: Array) -> Array:
            left, matrix = jacobian(defect, now)
            return solve_dense(matrix, left)

        now = jax.lax.fori_loop(0, NEWTON_STEPS, lambda _, each: each - correction(each), before)
        return now, (now, jnp.max(jnp.abs(correction(now)) / scale))

    return jax.lax.scan(advance, jnp.zeros(size), along)[1]


def _before(now: Float[Array, "n s"], along: Samples) -> Float[Array, "n s"]:
    """The same a sample earlier; at rest before the first of each test."""
    earlier = jnp.concatenate([jnp.zeros_like(now[:1]), now[:-1]])
    return (1.0 - along.begins)[:, None] * earlier


def _course(model: AbstractPlant, along: Samples, now: Float[Array, "n s"], step: float) -> Course:
    """States at samples as the equations take them: between the ends of each step."""
    weight, before = _weights(model), _before(now, along)
    return Course(weight * now + (1.0 - weight) * before, (now - before) / step)


def _moved(
    model: AbstractPlant,
    p: Values,
    along: Samples,
    step: float,
    now: Float[Array, "n s"],
    directions: Values,
    wanted: Array,
) -> Float[Array, "k n s"]:
    """Change of the states at the samples per unit of the wanted ones of k directions of the parameters.

    By the implicit function theorem at each sample, all at once; only the sum over time is taken step by step.
    """
    count, before = next(iter(directions.values())).size, _before(now, along)
    if now.shape[1] == 0:
        return jnp.zeros((count, *now.shape))

    def carried(at: Samples, now: Array, before: Array) -> tuple[Array, Array]:
        _, ahead = jacobian(lambda each: _defect(model, p, at, step, each, before), now)
        _, behind = jacobian(lambda each: _defect(model, p, at, step, now, each), before)
        behind = (1.0 - at.begins) * behind
        return ahead, jax.vmap(lambda column: -solve_dense(ahead, column), in_axes=1, out_axes=1)(behind)

    def forced(direction: Values) -> Array:
        def at_sample(at: Samples, now: Array, before: Array, ahead: Array) -> Array:
            def of(p: Values) -> Array:
                return _defect(model, p, at, step, now, before)

            return -solve_dense(ahead, jax.jvp(of, (dict(p),), (direction,))[1])

        return jax.vmap(at_sample)(along, now, before, ahead)

    def advance(moved: Array, by: tuple[Array, Array]) -> tuple[Array, Array]:
        carried, forced = by
        moved = carried @ moved + forced
        return moved, moved

    ahead, carry = jax.vmap(carried)(along, now, before)
    steps = carry, jnp.moveaxis(along_first(forced, dict(directions), wanted, now), 0, 2)
    return jnp.moveaxis(jax.lax.scan(advance, jnp.zeros((now.shape[1], count)), steps)[1], 2, 0)


def _force(
    model: AbstractPlant,
    p: Values,
    along: Samples,
    course: Course,
    imposed: Mapping[str, Float[Array, "n ..."]],
) -> Float[Array, " n"]:
    """What the drive would have had to exert [N], with signals (n,) or (n, 2) ``imposed`` at ports [SI]."""

    def at(now: Samples, s: Array, sd: Array, imposed: Mapping[str, Array]) -> Array:
        motion, (recorded, *beside), fundamental = _at(model, now)

        def out_of_balance(drive: Array) -> Array:
            u = model.drive((recorded._replace(value=drive), *beside), fundamental, imposed)
            return model.residual(p, motion, s, sd, u)[0]

        r, slope = jax.jvp(out_of_balance, (now.drive,), (jnp.ones_like(now.drive),))
        return now.drive - r / slope

    return jax.vmap(at)(along, *course, dict(imposed))


@eqx.filter_jit
def needed_force(model: AbstractPlant, p: Values, along: Samples, step: float) -> Needed:
    """What the drive would have had to exert, and whether the states were found."""
    now, left = _march(model, p, along, step)
    course = _course(model, along, now, step)
    force = _force(model, p, along, course, nothing_imposed(model.ports, along.q))
    return Needed(force, jnp.max(left))


@eqx.filter_jit
def needed_forces(
    model: AbstractPlant, several: Mapping[str, Float[Array, " k"]], along: Samples, step: float
) -> Needed:
    """What :func:`needed_force` gives at several values of the parameters, (k, n) and (k,)."""
    return jax.vmap(lambda p: needed_force(model, p, along, step))(dict(several))


@eqx.filter_jit
def force_slopes(
    model: AbstractPlant,
    p: Values,
    along: Samples,
    step: float,
    directions: Mapping[str, Float[Array, " k"]],
    wanted: Array,
) -> NeededSlopes:
    """What :func:`needed_force` gives, and slopes of the force along the first ``wanted`` directions of k."""
    now, left = _march(model, p, along, step)
    course, blank = _course(model, along, now, step), nothing_imposed(model.ports, along.q)

    def force(p: Values, now: Array) -> Array:
        return _force(model, p, along, _course(model, along, now, step), blank)

    def slope(given: tuple[Values, Array]) -> Array:
        return jax.jvp(force, (dict(p), now), given)[1]

    moved = _moved(model, p, along, step, now, dict(directions), wanted)
    slopes = along_first(slope, (dict(directions), moved), wanted, along.q)
    return NeededSlopes(Needed(_force(model, p, along, course, blank), jnp.max(left)), slopes)


@eqx.filter_jit
def force_gain(model: AbstractPlant, p: Values, along: Samples, step: float, port: str) -> Float[Array, " n"]:
    """Change of the needed force per unit of a signal imposed at a port [N per the port's unit], (n,)."""
    course = _course(model, along, _march(model, p, along, step)[0], step)
    blank = nothing_imposed(model.ports, along.q)
    unit = jnp.zeros_like(blank[port])
    unit = unit.at[:, 0].set(1.0) if unit.ndim == 2 else jnp.ones_like(unit)

    def of(signal: Array) -> Array:
        return _force(model, p, along, course, blank | {port: signal})

    return jax.jvp(of, (blank[port],), (unit,))[1]


@eqx.filter_jit
def ports_along(model: AbstractPlant, p: Values, along: Samples, step: float) -> AtPorts:
    """What laws see at the ports at every sample, (n,) each."""

    def at(now: Samples, s: Array, sd: Array) -> AtPorts:
        motion, signals, fundamental = _at(model, now)
        return model.at_ports(p, motion, s, sd, model.drive(signals, fundamental))

    return jax.vmap(at)(along, *_course(model, along, _march(model, p, along, step)[0], step))
