"""Typical sizes at the ports of a plant that its recordings contradict are taken from these.

A plant declares how far, how fast and how strongly things typically move at its ports, and laws take their own sizes
from that: how wide a prior is, where a search begins, how far a stop is away. Where a declared size is far from the
recorded motion, or was left at its default, a stop would stand in the way of the baseline, and a friction would hold
it fast. A force that matters is one that changes the readings by :data:`SHARE` of themselves.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import Port, PortKind
from savgs_ident.inference.background.imposed import impose, node_loads
from savgs_ident.inference.likelihood import likelihood_of
from savgs_ident.inference.problem import harmonic_target
from savgs_ident.plants.model import Model, PlantModel
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.periodic import simulate_periodic

SHARE = 0.35
"""Share of the readings that a force changes where it typically matters. Origin: by choice, as along a drive."""

REACHED = 2.5
"""A motion so many times as far as declared is beyond the stops that are looked for, five times as far at most."""

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
    target = harmonic_target(measured, bare.channels, measured.orders)
    likelihood = likelihood_of(target)
    seen, _ = node_loads(bare, p, solution)
    reached = {port.name: float(np.max(np.abs(seen[port.name].displacement))) for port in ports}
    fast = {port.name: np.asarray(seen[port.name].velocity) for port in ports}
    moving = [port for port in ports if reached[port.name] > 0.0 and np.max(np.abs(fast[port.name])) > 0.0]
    pushes = [(port.name, fast[port.name] / np.max(np.abs(fast[port.name]))) for port in moving]
    answers = impose(bare, likelihood, target.used.shape[2] - 1, p, solution, pushes)
    size = _channel_sizes(np.asarray(likelihood.measured), likelihood.channel)
    resized, warnings = {}, []
    for port, rows in zip(moving, answers, strict=True):
        gain = float(np.sqrt(np.sum((rows / size) ** 2)))
        whole = float(np.sqrt(np.sum((np.asarray(likelihood.measured) / size) ** 2)))
        matters = SHARE * whole / gain if gain > 0.0 else port.force
        found = _sized(port, reached[port.name], float(np.max(np.abs(fast[port.name]))), matters)
        if found != port:
            resized[port.name] = found
            warnings.append(_warning(port, found))
    return (model.sized(resized), tuple(warnings)) if resized else (model, ())


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
