"""Motions close to a known one: by its linearisation where that leads there, by Newton's method elsewhere.

Close by, the linearisation of the known motion serves in place of one's own: a chord step takes a third of the time
of an iteration. In most dwells the second is a hundred times shorter than the first. It is not where friction sticks
now at another instant; these dwells go on by Newton's method, as many at a time as a part of the nodes has room for.
So the worst dwell is not waited for by all others.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.collocation import (
    Linearised,
    Trajectory,
    apply_nodes,
    residual_at_nodes,
    solve_linearised,
    step_defects,
)
from savgs_ident.simulate.excitation import motion_scale, signals_at
from savgs_ident.simulate.mesh import CHUNK, Layout, over_dwells
from savgs_ident.simulate.periodic import PeriodicSolution, node_rates, node_steps, solve_newton

SLOWEST = 0.9
"""Largest ratio of two chord steps [1] that is reckoned with: of what is rounding it is about one."""

_LEAST = float(np.finfo(np.float64).tiny)

SHARE_AT_A_TIME = 1 / 5
"""Share of the nodes that Newton's method is applied to at a time, or those of the largest dwell."""


class _Equations(NamedTuple):
    """What is solved at the nodes: the plant, its parameters [SI], what is prepared from them, and what drives it.

    ``steps`` [s] lead from node to node, (P,), ``scale`` is the size of each state [its unit], (m, P).
    """

    model: AbstractPlant
    p: Values
    prepared: Any
    u: Any
    steps: Float[Array, " P"]
    scale: Float[Array, "m P"]


class _Progress(NamedTuple):
    """Motions at the nodes, and what is left of each dwell relative to the size of its motion [1], (D,).

    Where Newton's method was applied that is its last step. ``lost`` is whether it did not find some dwell.
    """

    at: Trajectory
    left: Float[Array, " D"]
    lost: Bool[Array, ""]


def solve_near(
    model: AbstractPlant,
    p: Values,
    known: PeriodicSolution,
    start: Trajectory,
    limit: int,
    enough: float,
    closely: float,
) -> tuple[Trajectory, Float[Array, ""]]:
    """Motions on the nodes of a ``known`` solution from a close ``start``, and the most that is left of one [1].

    To be a part of a larger program that is compiled. Chord steps suffice where what is left of a dwell is below
    ``closely``, Newton's where the last one is below ``enough``: what it leaves is far smaller. Look at what is left:
    it is above ``enough`` where ``limit`` iterations were too few.
    """
    excitation, mesh = known.excitation, known.mesh
    layout = mesh.layout
    signals, turning = signals_at(model, excitation, mesh)
    scale = motion_scale(model, signals, excitation, layout)
    u = model.drive(signals, turning)
    equations = _Equations(model, p, model.prepare(p), u, node_steps(excitation, mesh), scale)

    def unfinished(now: _Progress) -> Array:
        return jnp.any(now.left > enough) & ~now.lost

    def advance(now: _Progress) -> _Progress:
        return _worst_solved(equations, layout, now, limit, enough)

    begin = _by_chords(equations, layout, known.linearised, start, closely)
    found = jax.lax.while_loop(unfinished, advance, begin)
    return found.at, jnp.max(found.left)


def _by_chords(
    equations: _Equations, layout: Layout, lin: Linearised, start: Trajectory, closely: float
) -> _Progress:
    """Two chord steps; of dwells that they do not lead ``closely`` to their motion, the start."""
    once, first = _chord_step(equations, layout, lin, start)
    twice, second = _chord_step(equations, layout, lin, once)
    ratio = jnp.minimum(second / jnp.maximum(first, _LEAST), SLOWEST)
    left = second * ratio / (1.0 - ratio)
    close = left <= closely
    there = close[layout.dwell]
    at = jax.tree.map(lambda new, old: jnp.where(there, new, old), twice, start)
    return _Progress(at, jnp.where(close, left, jnp.inf), jnp.asarray(False))


def _chord_step(
    equations: _Equations, layout: Layout, lin: Linearised, at: Trajectory
) -> tuple[Trajectory, Float[Array, " D"]]:
    model, p, prepared, u, steps, scale = equations
    residual = residual_at_nodes(model, p, prepared, (*at.x, *at.y), u)
    imbalance = -apply_nodes(lin.per_residual, residual)
    defects = step_defects(model, at, node_rates(model, at, imbalance), layout, steps)
    change = solve_linearised(layout, lin, defects, imbalance)
    length = over_dwells(jnp.max(jnp.abs(change.x) / scale, axis=0), layout)
    return Trajectory(at.x + change.x, at.y + change.y), length


class _Part(NamedTuple):
    """Some dwells of a layout as a :class:`NodeOrder` of their own, and which of its nodes they are.

    ``nodes`` are numbers of nodes of the layout, (P,), in places that no dwell needs those of another; ``write_to``
    are the same, but one beyond the last in such places. ``dwells`` are numbers of dwells, (D,), one beyond the last
    where there is none.
    """

    dwell: Int[Array, " P"]
    following: Int[Array, " P"]
    preceding: Int[Array, " P"]
    chunk_table: Int[Array, "D most"]
    chunk_place: Int[Array, " C"]
    loose: Array | None
    nodes: Int[Array, " P"]
    write_to: Int[Array, " P"]
    dwells: Int[Array, " D"]


def worst_dwells(layout: Layout, left: Float[Array, " D"], enough: float, room: int) -> _Part:
    """Those dwells of which most is ``left`` [1], more than ``enough``, and as there is ``room`` for in chunks."""
    chunks = np.asarray(layout.counts) // CHUNK
    slots = min(len(chunks), room // int(chunks.min()))
    most, first = int(chunks.max()), jnp.asarray(layout.starts // CHUNK)
    worst = jnp.argsort(-left)[:slots]
    size = jnp.where(left[worst] > enough, jnp.asarray(chunks)[worst], 0)
    ends = jnp.cumsum(size)
    size = jnp.where(ends <= room, size, 0)
    begins = jnp.where(ends <= room, ends - size, 0)

    chunk = jnp.arange(room)
    slot = jnp.sum(chunk[:, None] >= ends, axis=1)
    taken = (slot < slots) & (jnp.append(ends, room + 1)[slot] <= room)
    owner = jnp.minimum(slot, slots - 1)
    source = jnp.where(taken, first[worst[owner]] + chunk - begins[owner], 0)
    place = jnp.arange(most)
    table = jnp.where(place < size[:, None], begins[:, None] + place, room)

    node = jnp.arange(room * CHUNK)
    within, mine = node % CHUNK, node // CHUNK
    valid, owned = taken[mine], owner[mine]
    low, high = begins[owned] * CHUNK, (begins + size)[owned] * CHUNK
    following = jnp.where(node + 1 == high, low, node + 1)
    preceding = jnp.where(node == low, high - 1, node - 1)
    nodes = source[mine] * CHUNK + within
    return _Part(
        dwell=jnp.where(valid, owned, slots),
        following=jnp.where(valid, following, node),
        preceding=jnp.where(valid, preceding, node),
        chunk_table=table,
        chunk_place=jnp.where(taken, owner * most + chunk - begins[owner], 0),
        loose=None if layout.loose is None else jnp.asarray(layout.loose)[nodes],
        nodes=nodes,
        write_to=jnp.where(valid, nodes, layout.total),
        dwells=jnp.where(size > 0, worst, len(chunks)),
    )


def _worst_solved(
    equations: _Equations, layout: Layout, now: _Progress, limit: int, enough: float
) -> _Progress:
    """Newton's method applied to the dwells that are worst off."""
    room = max(max(layout.counts), int(SHARE_AT_A_TIME * layout.total)) // CHUNK
    part = worst_dwells(layout, now.left, enough, room)
    model, p, prepared, u, steps, scale = equations
    found = solve_newton(
        model,
        p,
        prepared,
        jax.tree.map(lambda each: each[:, part.nodes], now.at),
        jax.tree.map(lambda each: each[part.nodes] if each.ndim else each, u),
        part,
        steps[part.nodes],
        scale[:, part.nodes],
        jnp.asarray(limit),
        jnp.asarray(enough),
    )
    at = jax.tree.map(
        lambda every, some: every.at[:, part.write_to].set(some, mode="drop"), now.at, found.trajectory
    )
    left = now.left.at[part.dwells].set(found.last_step, mode="drop")
    return _Progress(at, left, ~jnp.all(found.last_step <= enough))
