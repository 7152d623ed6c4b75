"""A motion from node to node in the order of time: where the search for the motion in a window begins.

A window is long, and a motion that is far from balance has no linearisation that forgets its past: over thousands of
nodes nothing is left of a step of Newton's method. So the motion is followed first, by backward Euler, from where the
plant is carried along by its inputs. It need not be exact.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.simulate.collocation import Trajectory, node_motion
from savgs_ident.simulate.excitation import signals_at
from savgs_ident.simulate.mesh import Mesh
from savgs_ident.simulate.program_cache import run_cached

ROUNDS = 6
"""Newton steps at each node."""


@eqx.filter_jit
def march(*args: Any) -> Trajectory:
    """The motion on the nodes of a mesh, as many in every window, from the state ``first`` (m, D) in SI.

    The arguments are the plant, its parameters, what it prepares from them, what drives it, the mesh, and ``first``.
    """
    return Trajectory(*run_cached(_marched, *args))


def _marched(
    model: AbstractPlant,
    p: Values,
    prepared: Any,
    excitation: Excitation,
    mesh: Mesh,
    first: Float[Array, "m D"],
) -> tuple[Array, Array]:
    windows, n = excitation.frequency.shape[0], len(model.coordinates)
    u = model.drive(*signals_at(model, excitation, mesh))
    by_node = jax.tree.map(lambda each: jnp.reshape(each, (windows, -1)).T, u)
    step = jnp.reshape(jnp.asarray(mesh.gap), (windows, -1)).T / (2.0 * jnp.pi * excitation.frequency)

    def reached(x: Array, y: Array, h: Array) -> Array:
        speed = x[n : 2 * n] + h * y[:n]
        return jnp.concatenate([x[:n] + h * speed, speed, x[2 * n :] + h * y[n:]])

    def residual(x: Array, y: Array, h: Array, u: Any) -> Array:
        motion, s, sd = node_motion(model, (*reached(x, y, h), *y))
        return model.residual(p, motion, s, sd, u, prepared)

    def one(x: Array, y: Array, h: Array, u: Any) -> tuple[Array, Array]:
        def improved(_: Any, y: Array) -> Array:
            change = jnp.linalg.solve(jax.jacfwd(residual, 1)(x, y, h, u), residual(x, y, h, u))
            return jnp.where(jnp.all(jnp.isfinite(change)), y - change, y)

        y = jax.lax.fori_loop(0, ROUNDS, improved, y)
        return reached(x, y, h), y

    def on(
        at: tuple[Array, Array], given: tuple[Array, Any]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        x, y = jax.vmap(one)(*at, *given)
        return (x, y), (x, y)

    still = jnp.zeros((windows, first.shape[0] - n))
    _, (x, y) = jax.lax.scan(on, (first.T, still), (step, by_node))
    return _as_nodes(x), _as_nodes(y)


def _as_nodes(values: Float[Array, "N D k"]) -> Float[Array, "k P"]:
    """What is known at every instant of all windows, one window after the other."""
    return jnp.reshape(jnp.moveaxis(values, 1, 0), (-1, values.shape[-1])).T
