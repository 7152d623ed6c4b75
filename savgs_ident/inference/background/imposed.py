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
from jaxtyping import Array, Complex
from numpy.typing import NDArray

from savgs_ident.core.threads import in_parallel
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Load, PortSignals
from savgs_ident.effects.composition import nothing_imposed
from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.plants.base import AbstractPlant, AtPorts
from savgs_ident.responses.harmonic_response import ComparedPart
from savgs_ident.simulate.mesh import Mesh
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import first_alone, placed, run_cached
from savgs_ident.simulate.readings import Sensors, readings_of, sensors_of, shown_by
from savgs_ident.simulate.sensitivity import (
    TOGETHER,
    Directions,
    Seen,
    along_first,
    answers,
    directions_of,
    ports_at_nodes,
    seen_along,
    shown_along,
    unit_tangents,
)


def rows_of(
    model: AbstractPlant, likelihood: Likelihood, p: Values, solution: PeriodicSolution, orders: int
) -> Array:
    """Rows of a motion [unit of the reading], (m,)."""
    seen = _seen(model, p, solution, orders)
    return _rows(likelihood, seen, solution.excitation.part, solution.mesh)


def harmonics_of_motion(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int
) -> Complex[Array, "D C K"]:
    """Complex harmonics of a motion [unit of the reading], (D, C, orders + 1), by the program that its rows have."""
    return _harmonics(_seen(model, p, solution, orders), solution.excitation.part, solution.mesh)


@eqx.filter_jit
def _seen(model: AbstractPlant, p: Values, solution: PeriodicSolution, orders: int) -> Seen:
    readings = readings_of(model, p, solution.trajectory, solution)
    return Seen(readings, sensors_of(model, p, solution.excitation, orders))


# Apart from what is seen: what sensors show of it is the same program for all plants.
@eqx.filter_jit
def _rows(likelihood: Likelihood, seen: Seen, part: ComparedPart | None, mesh: Mesh) -> Array:
    return likelihood.rows(shown_by(seen.sensors, seen.readings, part, mesh))


@eqx.filter_jit
def _harmonics(seen: Seen, part: ComparedPart | None, mesh: Mesh) -> Complex[Array, "D C K"]:
    return shown_by(seen.sensors, seen.readings, part, mesh)


@eqx.filter_jit
def _rows_along(*args: Any) -> tuple[Array, ...]:
    """Changes of the rows where what is seen changes, (k, m) [unit of the reading]."""
    return run_cached(_shown_rows, *args)


def _shown_rows(
    likelihood: Likelihood, seen: Seen, changes: Seen, wanted: Array, part: ComparedPart | None, mesh: Mesh
) -> tuple[Array]:
    return (shown_along(seen, changes, wanted, part, mesh, likelihood.rows),)


@eqx.filter_jit
def _seen_along(*args: Any) -> tuple[Array, ...]:
    return run_cached(_flat_seen_along, *args)


def _flat_seen_along(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, directions: Directions, orders: int
) -> tuple[Array, ...]:
    return tuple(jax.tree.leaves(seen_along(model, p, solution, orders, directions)))


def _shown(
    likelihood: Likelihood, flat: tuple[Array, ...], wanted: Array, solution: PeriodicSolution
) -> NDArray[np.float64]:
    """Changes of the rows, (k, m), by the arrays of what is seen and of its changes."""
    half = len(flat) // 2
    seen, changes = (Seen(readings, Sensors(*sensors)) for readings, *sensors in (flat[:half], flat[half:]))
    part, mesh = solution.excitation.part, solution.mesh
    (rows,) = first_alone(_rows_along, likelihood, seen, changes, wanted, part, mesh)
    return np.asarray(rows)


ROOM = 48
"""Directions, or signals, that programs have room for: one for each number would have to be compiled."""


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
    for first in range(0, len(names), ROOM):
        some = names[first : first + ROOM]
        tangents = unit_tangents(p, some, ROOM)
        directions = directions_of(model, p, placed(tangents), len(some))
        flat = _seen_along(model, p, solution, directions, orders)
        # Placed, as that of imposed signals is: so one program shows both.
        parts.append(_shown(likelihood, flat, placed(directions.wanted), solution)[: len(some)])
    return np.concatenate(parts).T


IMPOSED_NODES = 2**21
"""Most instants of signals in such a program. Origin: memory; of a minute of road it has room for all signals."""


def _batch(nodes: int) -> int:
    return max(TOGETHER, min(ROOM, IMPOSED_NODES // nodes // TOGETHER * TOGETHER))


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
        flat = first_alone(_answered, model, placed(dict(p)), solution, imposed, wanted, orders)
        return _shown(likelihood, flat, wanted, solution)[: len(some)]

    found = in_parallel(rows_of_some, range(0, len(signals), batch))
    return np.concatenate([np.zeros((0, likelihood.measured.size)), *found])


def rehearse(
    model: AbstractPlant, likelihood: Likelihood, orders: int, p: Values, blank: PeriodicSolution
) -> None:
    """Have compiled what gives answers to imposed signals and what ports see, on a :func:`blank_solution`."""
    nodes = blank.mesh.layout.total
    batch = _batch(nodes)
    imposed = placed((jnp.zeros(batch, int), jnp.zeros((batch, nodes, 2))))
    nothing = placed(jnp.asarray(0))
    flat = first_alone(_answered, model, placed(dict(p)), blank, imposed, nothing, orders)
    _shown(likelihood, flat, nothing, blank)
    node_loads(model, p, blank)


@eqx.filter_jit
def _answered(*args: Any) -> tuple[Array, ...]:
    return run_cached(_flat_answers, *args)


def _flat_answers(
    model: AbstractPlant,
    p: Values,
    solution: PeriodicSolution,
    imposed: tuple[Array, Array],
    wanted: Array,
    orders: int,
) -> tuple[Array, ...]:
    """What is seen, and its changes by signals (b, P, 2) at the ports of these places (b,).

    Of a force the first column counts. Sensors do not change.
    """
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

    seen = _seen(model, p, solution, orders)
    readings = along_first(reading, imposed, wanted, seen.readings)
    still = jax.tree.map(lambda each: jnp.zeros((len(readings), *each.shape), each.dtype), seen.sensors)
    return tuple(jax.tree.leaves((seen, Seen(readings, still))))


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
