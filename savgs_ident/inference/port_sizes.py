"""Typical sizes at the ports of a plant that its recordings contradict are taken from these.

A plant declares how far, how fast and how strongly things typically move at its ports, and laws take their own sizes
from that: how wide a prior is, where a search begins, how far a stop is away. Where a declared size is far from the
recorded motion, or was left at its default, a stop would stand in the way of the baseline, and a friction would hold
it fast. A force, or a deflection, that matters is one that changes the readings by :data:`SHARE` of themselves.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import Load, Port, PortKind, PortSignals
from savgs_ident.inference.background.imposed import impose, node_loads
from savgs_ident.inference.background.port_functions import mesh_points, rate_of
from savgs_ident.inference.likelihood import likelihood_of
from savgs_ident.inference.targets import harmonic_target
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import Model, PlantModel
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.periodic import PeriodicSolution, simulate_periodic

SHARE = 0.35
"""Share of the readings that a force changes where it typically matters. Origin: by choice, as along a drive."""

REACHED = 5.0
"""A motion so many times as far as declared is beyond all stops that are looked for. One that is not contradicts
nothing, and what is declared stays: laws that a model has already turn round over a part of it."""

FAR = 10.0
"""Factor by which a size is declared too large, or a velocity too small, where it is not believed."""

WEAK = 100.0
"""The same of a force, or of a deflection, that is declared too small: weak ones are looked for, too."""

STRONG = 30.0
"""The same of a force that is declared too large: a plant that is damped by little rings by far more without the
friction that it has, so that the force that would matter seems weaker than it is."""


def sized_to(model: Model, measured: HarmonicResponse) -> tuple[Model, tuple[DataWarning, ...]]:
    """The model with effects as large as recorded motions say where they contradict its plant, and a warning of each.

    A model whose motions are not found stays as it is.
    """
    if not isinstance(model, PlantModel):
        return model, ()
    bare, p = replace(model.build(), effects=()), as_values(model.table.as_dict())
    ports = [port for port in bare.scaled_ports if port.kind in (PortKind.FORCE, PortKind.SERIES)]
    solution = simulate_periodic(bare, p, measured_excitation(bare, measured, model.table))
    if not ports or not all(each.ok for each in solution.status()):
        return model, ()
    signals, loads = node_loads(bare, p, solution)
    asked = [*_forces(ports, signals), *_ways(ports, loads, solution)]
    changes = _changes_by(bare, p, measured, solution, [(each.port.name, each.signal) for each in asked])
    found = [each.sized(SHARE / change) for each, change in zip(asked, changes, strict=True) if change > 0.0]
    declared = {port.name: port for port in ports}
    resized = {port.name: port for port in found if port != declared[port.name]}
    if not resized:
        return model, ()
    return model.sized(resized), tuple(_warning(declared[name], port) for name, port in resized.items())


class _Asked(NamedTuple):
    """A signal of size one that is imposed at a port, and the port as it is where so much of it matters."""

    port: Port
    signal: NDArray[np.float64]
    sized: Callable[[float], Port]


def _forces(ports: Sequence[Port], signals: Mapping[str, PortSignals]) -> Iterator[_Asked]:
    """A force along the velocity at every force port where something moves."""
    for port in ports:
        if port.kind is PortKind.FORCE:
            seen = signals[port.name]
            reached, fast = _largest(seen.displacement), _largest(seen.velocity)
            if min(reached, fast) > 0.0:
                yield _Asked(port, np.asarray(seen.velocity) / fast, partial(_sized, port, reached, fast))


def _ways(ports: Sequence[Port], loads: Mapping[str, Load], solution: PeriodicSolution) -> Iterator[_Asked]:
    """What gives way along the load at every series port where it changes."""
    for port in ports:
        if port.kind is PortKind.SERIES:
            load = np.asarray(loads[port.name].beyond_rest)
            carried = _largest(load)
            if carried > 0.0:
                way = load / carried
                rate = rate_of(way, mesh_points(solution), solution)
                sized = partial(_sized_to_give, port, carried, _largest(rate))
                yield _Asked(port, np.stack([way, rate], axis=1), sized)


def _largest(signal: Any) -> float:
    return float(np.max(np.abs(signal)))


def _changes_by(
    plant: AbstractPlant,
    p: Values,
    measured: HarmonicResponse,
    solution: PeriodicSolution,
    pushes: Sequence[tuple[str, NDArray[np.float64]]],
) -> list[float]:
    """By which share of themselves the readings change by each of several signals at ports, rms over channels [1]."""
    target = harmonic_target(measured, plant.channels, measured.orders)
    likelihood = likelihood_of(target)
    rows = np.asarray(likelihood.measured)
    size = _channel_sizes(rows, likelihood.channel)
    answers = impose(plant, likelihood, target.used.shape[2] - 1, p, solution, pushes)
    whole = float(np.linalg.norm(rows / size))
    return [float(np.linalg.norm(answer / size)) / whole for answer in answers]


def _channel_sizes(rows: NDArray[np.float64], channel: NDArray[np.intp]) -> NDArray[np.float64]:
    """The norm of the rows of each row's channel [its unit]."""
    return np.asarray(np.sqrt(np.bincount(channel, rows**2))[channel])


def _sized(port: Port, displacement: float, velocity: float, force: float) -> Port:
    """The port with sizes that were recorded in place of those that are far from them."""
    return replace(
        port,
        displacement=port.displacement
        if displacement / REACHED < port.displacement < FAR * displacement
        else displacement,
        velocity=port.velocity if velocity / FAR < port.velocity < FAR * velocity else velocity,
        force=port.force if force / WEAK < port.force < STRONG * force else force,
    )


def _sized_to_give(port: Port, carried: float, rate: float, displacement: float) -> Port:
    """The same of a series port, by the load that it carries and by how far it gives way where that matters.

    ``rate`` is the largest velocity over the displacement [1/s].
    """
    small, large = displacement / WEAK, FAR * displacement
    return replace(
        port,
        displacement=port.displacement if small < port.displacement < large else displacement,
        velocity=port.velocity if small < port.velocity / rate < large else rate * displacement,
        force=port.force if carried / FAR < port.force < FAR * carried else carried,
    )


def _warning(port: Port, found: Port) -> DataWarning:
    units = (port.displacement_unit, f"{port.displacement_unit}/s", port.force_unit)
    changed = [
        f"{name} {getattr(found, name):.2g} {unit} for {getattr(port, name):.2g}"
        for name, unit in zip(("displacement", "velocity", "force"), units, strict=True)
        if getattr(found, name) != getattr(port, name)
    ]
    return DataWarning(
        "port_size",
        f"port '{port.name}': its typical sizes are those along the recordings without effects: {', '.join(changed)}",
        remedy="declare sizes near these in the plant",
    )
