"""What the sensors read along periodic motions, as complex harmonics.

    response = harmonics(model, p, solution, orders=9)   # complex, (dwells, channels, 10)

What the truncation to a finite number of nodes costs is stated by :func:`truncation_error`, which solves once
more on twice as many nodes.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.collocation import Trajectory, node_motion
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.mesh import Layout, Mesh, turns
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution, adapt


def _readings(
    model: AbstractPlant, p: Values, trajectory: Trajectory, known: PeriodicSolution
) -> Float[Array, "P C"]:
    def one(u: Any, *parts: Array) -> tuple[Array, ...]:
        motion, states, rates = node_motion(model, parts)
        return model.read(p, motion, states, rates, u)

    u = inputs_at(model, known.excitation, known.mesh)
    return jnp.stack(jax.vmap(one)(u, *trajectory.x, *trajectory.y), axis=-1)


def analyse(signals: Float[Array, "P C"], mesh: Mesh, orders: int) -> Complex[Array, "D C K"]:
    """Complex harmonics 0..orders of C signals at the nodes of a mesh, in their own units."""
    twice = jnp.full(orders + 1, 2.0).at[0].set(1.0)
    kernel = twice * jnp.conj(turns(mesh.phase, orders))
    terms = signals[:, :, None] * (kernel * jnp.asarray(mesh.weight)[:, None])[:, None, :]
    layout = mesh.layout
    return jax.ops.segment_sum(terms, layout.dwell, len(layout.counts), indices_are_sorted=True)


@eqx.filter_jit
def harmonics(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    """Complex harmonics 0..orders of the sensor readings, (D, C, orders + 1), in the channels' SI units.

    Channels are those of the plant, in its order.
    """
    return harmonics_of(model, p, solution.trajectory, solution, orders)


def harmonics_of(
    model: AbstractPlant, p: Values, motions: Trajectory, known: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    """The same of motions on the nodes of a ``known`` solution, as a part of a larger program that is compiled.

    Each is in the unit of its reading.
    """
    seen = analyse(_readings(model, p, motions, known), known.mesh, orders)
    return seen * _sensors(model, p, known.excitation.frequency, orders)


def _sensors(
    model: AbstractPlant, p: Values, frequency: Float[Array, " D"], orders: int
) -> Complex[Array, "D C K"]:
    """What the sensors make of each order."""
    order = jnp.arange(orders + 1, dtype=frequency.dtype)
    return jnp.moveaxis(model.transfers(p, frequency[:, None] * order), 0, 1)


def truncation_error(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int
) -> Float[Array, "D C"]:
    """Largest change of any order 1..orders when the nodes are doubled, relative to the first harmonic [1].

    The error of ``solution`` itself is about four thirds of it (the rule is of second order).
    """
    doubled = Layout(tuple(2 * count for count in solution.mesh.layout.counts))
    finer = adapt(model, p, solution, doubled, PeriodicSettings.iterations)
    coarse, fine = (harmonics(model, p, each, orders) for each in (solution, finer))
    return jnp.max(jnp.abs(coarse - fine)[..., 1:], axis=-1) / jnp.abs(fine[..., 1])
