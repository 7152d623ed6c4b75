"""What a model reads along a periodic motion, and how that changes to first order.

By parameters of the model (:func:`slopes_in`), and by signals that are imposed at its ports (:func:`impose`); along
the motion the ports see what :func:`node_loads` gives.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.executor import in_parallel
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Load, PortSignals
from savgs_ident.effects.composition import nothing_imposed
from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.plants.base import AbstractPlant, AtPorts
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import placed, run_cached
from savgs_ident.simulate.readings import harmonics, shown_harmonics
from savgs_ident.simulate.sensitivity import (
    ANALYSED,
    TOGETHER,
    Directions,
    along_first,
    answers,
    directional,
    directions_of,
    ports_at_nodes,
    unit_tangents,
)


@eqx.filter_jit
def rows_of(
    model: AbstractPlant, likelihood: Likelihood, p: Values, solution: PeriodicSolution, orders: int
) -> Array:
    """Rows of a motion [unit of the reading], (m,)."""
    return likelihood.rows(harmonics(model, p, solution, orders))


@eqx.filter_jit
def _slopes_of(*args: Any) -> tuple[Array, ...]:
    """Their slopes along k directions of the parameters, (k, m) [unit of the reading]."""
    return run_cached(_directional_rows, *args)


def _directional_rows(
    model: AbstractPlant,
    likelihood: Likelihood,
    p: Values,
    solution: PeriodicSolution,
    directions: Directions,
    orders: int,
) -> tuple[Array]:
    return (directional(model, p, solution, orders, directions, likelihood.rows),)


WIDTH = 52
"""Directions that are solved for at a time: a program for each number would have to be compiled."""


def slopes_in(
    model: AbstractPlant,
    likelihood: Likelihood,
    orders: int,
    p: Values,
    solution: PeriodicSolution,
    names: Sequence[str],
) -> NDArray[np.float64]:
    """Slopes of the rows in the named parameters of ``model`` [units of the rows per SI unit], (m, n)."""
    parts = [np.zeros((0, likelihood.measured.size))]
    for first in range(0, len(names), WIDTH):
        some = names[first : first + WIDTH]
        tangents = unit_tangents(p, some, WIDTH)
        directions = directions_of(model, p, placed(tangents), len(some))
        (slopes,) = _slopes_of(model, likelihood, p, solution, directions, orders)
        parts.append(np.asarray(slopes)[: len(some)])
    return np.concatenate(parts).T


BATCH = 32
"""Signals that a program has room for: one for each number would have to be compiled."""

BATCHED_NODES = 2**21
"""Most instants of signals in such a program. Origin: memory; a minute of road has room for all of them."""


def _batch(nodes: int) -> int:
    return max(TOGETHER, min(BATCH, BATCHED_NODES // nodes // TOGETHER * TOGETHER))


def impose(
    model: AbstractPlant,
    likelihood: Likelihood,
    orders: int,
    p: Values,
    solution: PeriodicSolution,
    signals: Sequence[tuple[str, NDArray[np.float64]]],
) -> NDArray[np.float64]:
    """Change of the rows by signals at the nodes, (P,) or (P, 2) each, imposed one at a time; (signals, m).

    All in SI.
    """
    nodes = solution.mesh.layout.total
    ports, batch = [port.name for port in model.ports], _batch(nodes)

    def rows_of_some(first: int) -> NDArray[np.float64]:
        some = signals[first : first + batch]
        places, stacked = np.zeros(batch, np.int64), np.zeros((batch, nodes, 2))
        for number, (port, values) in enumerate(some):
            places[number] = ports.index(port)
            stacked[number, :, : 1 if values.ndim == 1 else 2] = values.reshape(nodes, -1)
        imposed = placed((jnp.asarray(places), jnp.asarray(stacked)))
        wanted = placed(jnp.asarray(len(some)))
        (rows,) = _answered(model, likelihood, placed(dict(p)), solution, imposed, wanted, orders)
        return np.asarray(rows)[: len(some)]

    # The first alone: two at a time would compile the same program twice.
    first, others = range(0, len(signals), batch)[:1], range(batch, len(signals), batch)
    found = [*map(rows_of_some, first), *in_parallel(rows_of_some, others)]
    return np.concatenate([np.zeros((0, likelihood.measured.size)), *found])


@eqx.filter_jit
def _answered(*args: Any) -> tuple[Array, ...]:
    return run_cached(_answer_rows, *args)


def _answer_rows(
    model: AbstractPlant,
    likelihood: Likelihood,
    p: Values,
    solution: PeriodicSolution,
    imposed: tuple[Array, Array],
    wanted: Array,
    orders: int,
) -> tuple[Array]:
    """Rows of signals (b, P, 2) at the ports of these places (b,); of a force the first column counts."""
    answer = answers(model, p, solution)
    blank = nothing_imposed(model.ports, jnp.zeros(solution.mesh.layout.total))

    def reading(given: tuple[Array, Array]) -> Array:
        place, signal = given
        return answer(
            {
                port.name: jnp.where(
                    place == number, signal if blank[port.name].ndim == 2 else signal[:, 0], 0.0
                )
                for number, port in enumerate(model.ports)
                if port.name in blank
            }
        )

    def rows(readings: Array) -> Array:
        return likelihood.rows(shown_harmonics(model, p, readings, solution, orders))

    like = jax.ShapeDtypeStruct((solution.mesh.layout.total, len(model.channels)), likelihood.measured.dtype)
    readings = along_first(reading, imposed, wanted, like)
    return (along_first(rows, readings, wanted, likelihood.measured, ANALYSED),)


def node_loads(
    model: AbstractPlant, p: Values, solution: PeriodicSolution
) -> tuple[dict[str, PortSignals], dict[str, Load]]:
    """What the forces at each port see at the nodes, and the loads in which something may give way; (P,) each."""
    ports, carried, _ = _at_ports(model, placed(dict(p)), solution)
    whole = {
        name: Load(load.total, jnp.broadcast_to(load.rest, load.total.shape))
        for name, load in carried.items()
    }
    return ports, whole


@eqx.filter_jit
def _at_ports(model: AbstractPlant, p: Values, solution: PeriodicSolution) -> AtPorts:
    return ports_at_nodes(model, p, solution)
