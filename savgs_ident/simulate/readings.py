"""What sensors read along periodic motions: their harmonics, of whole periods or of the part that is compared."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.responses.harmonic_response import ComparedPart, compared_share
from savgs_ident.simulate.collocation import Trajectory, node_motion
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.mesh import Mesh, waves
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import placed

Share = Callable[[Array, Array, Array], Array]
"""With what share an instant counts, from its phase and those where the comparison begins and ends."""


def _share(phase: Array, begin: Array, end: Array) -> Array:
    share: Array = cast(Any, compared_share)(phase, begin, end)
    return share


def _share_rate(phase: Array, begin: Array, end: Array) -> Array:
    """Its change with the phase [1/rad]."""
    return jax.jvp(lambda each: _share(each, begin, end), (phase,), (jnp.ones_like(phase),))[1]


def readings_of(
    model: AbstractPlant, p: Values, motions: Trajectory, known: PeriodicSolution
) -> Float[Array, "P C"]:
    """What sensors without dynamics read of motions on the nodes of a ``known`` solution, each in its unit."""

    def one(u: Any, *parts: Array) -> tuple[Array, ...]:
        motion, states, rates = node_motion(model, parts)
        return model.read(p, motion, states, rates, u)

    u = inputs_at(model, known.excitation, known.mesh)
    return jnp.stack(jax.vmap(one)(u, *motions.x, *motions.y), axis=-1)


def analyse(
    signals: Float[Array, "P C"],
    mesh: Mesh,
    orders: int,
    part: ComparedPart | None = None,
    share: Share = _share,
) -> Complex[Array, "D C K"]:
    """Complex harmonics 0..orders of C signals at the nodes of a mesh, in their own units.

    Where only a ``part`` of each period is compared, those of the signals times their ``share``, every so many-th of
    them.
    """
    phase, weight = jnp.asarray(mesh.phase), jnp.asarray(mesh.weight)
    if part is not None:
        begin, end, every = (jnp.asarray(each)[mesh.layout.dwell] for each in part[:3])
        weight = weight * share(phase, begin, end)
        phase = phase * every
    cosines, sines = waves(phase, orders)
    table, counted = jnp.concatenate([cosines, -sines]), (signals * weight[:, None]).T
    edges = pairwise((*mesh.layout.starts, mesh.layout.total))
    # A matrix product for each dwell: its nodes are a sum over the last axis of both.
    seen = jnp.stack([counted[:, here:end] @ table[:, here:end].T for here, end in edges])
    twice = jnp.full(orders + 1, 2.0).at[0].set(1.0)
    return twice * (seen[..., : orders + 1] + 1j * seen[..., orders + 1 :])


def harmonics(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    """Complex harmonics 0..orders of the sensor readings, (D, C, orders + 1), in the channels' SI units.

    Channels are those of the plant, in its order. A program of its own; for parts of another there is
    :func:`harmonics_of`.
    """
    p, solution = placed((dict(p), solution))
    return _harmonics(model, p, solution, orders)


@eqx.filter_jit
def _harmonics(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    return harmonics_of(model, p, solution.trajectory, solution, orders)


def harmonics_of(
    model: AbstractPlant, p: Values, motions: Trajectory, known: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    """The same of motions on the nodes of a ``known`` solution, as a part of a larger program that is compiled.

    Each is in the unit of its reading.
    """
    excitation = known.excitation
    sensors = sensors_of(model, p, excitation, orders)
    return shown_by(sensors, readings_of(model, p, motions, known), excitation.part, known.mesh)


class Sensors(NamedTuple):
    """What the sensors make of each order of each test [1], (D, C, K).

    ``slope`` is its change per order [1] where a part of each period is compared and sensors have dynamics.
    """

    transfer: Complex[Array, "D C K"]
    slope: Complex[Array, "D C K"] | None = None


def sensors_of(model: AbstractPlant, p: Values, excitation: Excitation, orders: int) -> Sensors:
    """The sensors of a plant in given tests, up to an order."""
    order = jnp.arange(orders + 1, dtype=excitation.spacing.dtype)

    def transfer(spacing: Float[Array, " D"]) -> Complex[Array, "D C K"]:
        return jnp.moveaxis(model.transfers(p, spacing[:, None] * order), 0, 1)

    if excitation.part is None or not model.sensors_have_dynamics:
        return Sensors(transfer(excitation.spacing))
    shown, slope = jax.jvp(transfer, (excitation.spacing,), (excitation.frequency,))
    return Sensors(shown, slope / jnp.maximum(order, 1))


def shown_by(
    sensors: Sensors, readings: Float[Array, "P C"], part: ComparedPart | None, mesh: Mesh
) -> Complex[Array, "D C K"]:
    """Harmonics of what sensors show, dynamics and all, who read ``readings`` at the nodes; linear in both.

    Nothing here is of one plant: a program of it serves all.
    """
    orders = sensors.transfer.shape[-1] - 1
    seen = analyse(readings, mesh, orders, part) * sensors.transfer
    if sensors.slope is None:
        return seen
    # A sensor shows the past. So the share counts for what it shows, which is not what it makes of the share of the
    # truth: to first order they are apart by the slope of its response times the rate of the share.
    return seen + 1j * sensors.slope * analyse(readings, mesh, orders, part, _share_rate)
