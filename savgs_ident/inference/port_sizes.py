"""Typical sizes at the ports of a plant that its recordings contradict are taken from these.

A plant declares how far, how fast and how strongly things typically move at its ports, and laws take their own sizes
from that: how wide a prior is, where a search begins, how far a stop is away. Where a declared size is far from the
recorded motion, or was left at its default, a stop would stand in the way of the baseline, and a friction would hold
it fast. A force that matters is one that changes the readings by :data:`SHARE` of themselves.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import Port, PortKind
from savgs_ident.inference.background.imposed import impose, node_loads
from savgs_ident.inference.likelihood import likelihood_of
from savgs_ident.inference.problem import harmonic_target
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
"""The same of a force that is declared too small: weak ones are looked for, too."""


def sized_to(model: Model, measured: HarmonicResponse) -> tuple[Model, tuple[DataWarning, ...]]:
    """The model with effects as large as recorded motions say where they contradict its plant, and a warning of each.

    A model whose motions are not found stays as it is.
    """
    if not isinstance(model, PlantModel):
        return model, ()
    bare, p = replace(model.build(), effects=()), as_values(model.table.as_dict())
    ports = [port for port in bare.ports if port.kind is PortKind.FORCE]
    solution = simulate_periodic(bare, p, measured_excitation(bare, measured, model.table))
    if not ports or not all(each.ok for each in solution.status()):
        return model, ()
    seen, _ = node_loads(bare, p, solution)
    reached = {port.name: _largest(seen[port.name].displacement) for port in ports}
    fast = {port.name: _largest(seen[port.name].velocity) for port in ports}
    moving = [port for port in ports if min(reached[port.name], fast[port.name]) > 0.0]
    pushes = [(port.name, np.asarray(seen[port.name].velocity) / fast[port.name]) for port in moving]
    changes = _changes_by(bare, p, measured, solution, pushes)
    resized = {}
    for port, change in zip(moving, changes, strict=True):
        force = SHARE / change if change > 0.0 else port.force
        found = _sized(port, reached[port.name], fast[port.name], force)
        if found != port:
            resized[port.name] = found
    if not resized:
        return model, ()
    return model.sized(resized), tuple(
        _warning(port, resized[port.name]) for port in moving if port.name in resized
    )


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
        force=port.force if force / WEAK < port.force < FAR * force else force,
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
        f"port '{port.name}': its typical sizes are those of the recorded motion: {', '.join(changed)}",
        remedy="declare these sizes in the plant",
    )
