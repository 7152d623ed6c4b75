"""What drives a plant in periodic tests, and what of a campaign a model is held against.

A plant is driven by the harmonics of its inputs, as they are given or as they were recorded, at the nodes of a mesh.
A model is held against the response of the campaign's dwells, or of those of them that a command is asked to look at.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.effects.base import Fundamental, InputSignal
from savgs_ident.plants.base import AbstractPlant, Excitation, Input
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse
from savgs_ident.responses.sweeps import estimate_sweep_response
from savgs_ident.simulate.mesh import Mesh, turns

SIGNIFICANT = 4.0
"""Harmonics below this many standard deviations are taken as noise and not imposed."""


def signals_at(
    plant: AbstractPlant, excitation: Excitation, mesh: Mesh
) -> tuple[tuple[InputSignal, ...], Fundamental]:
    """Value and rate of every input at the nodes of a mesh, (P,) each, and the angle of the test."""
    dwell, phase = mesh.layout.dwell, jnp.asarray(mesh.phase)
    omega = 2.0 * jnp.pi * excitation.frequency[dwell]
    harmonics = [excitation.harmonics[each.name] for each in plant.inputs]
    first = harmonics[0]
    offset = jnp.angle(first[:, 1]) if first.shape[1] > 1 else jnp.zeros(())
    fundamental = Fundamental(phase + jnp.broadcast_to(offset, excitation.frequency.shape)[dwell], omega)
    return tuple(InputSignal(*_synthesise(each[dwell], omega, phase)) for each in harmonics), fundamental


def inputs_at(plant: AbstractPlant, excitation: Excitation, mesh: Mesh) -> Any:
    """The plant's inputs at the nodes of a mesh; every field is of shape (P,)."""
    return plant.drive(*signals_at(plant, excitation, mesh))


def _synthesise(harmonics: Array, omega: Array, phase: Array) -> tuple[Array, Array]:
    """Value and time derivative at the nodes, both (P,), from harmonics (P, K)."""
    order = jnp.arange(harmonics.shape[1])
    terms = harmonics * turns(phase, harmonics.shape[1] - 1)
    return jnp.sum(terms.real, axis=1), jnp.sum((1j * order * terms).real, axis=1) * omega


def typical_amplitude(plant: AbstractPlant | type[AbstractPlant], table: ParameterTable) -> float:
    """Amplitude of the first input in a test [its unit]: half of its stroke, where it declares one.

    Otherwise the largest with which no coordinate moves by more than its typical size.
    """
    driven = plant.inputs[0]
    if driven.stroke:
        return table[driven.stroke].value / 2.0
    moved = zip(plant.coordinates, driven.moves, strict=True)
    return min(each.size / abs(moves) for each, moves in moved if moves)


def resting_values(plant: AbstractPlant | type[AbstractPlant], table: ParameterTable) -> dict[str, float]:
    """What each input is at rest [its unit], by its name."""
    return {each.name: table[each.rest].value if each.rest else 0.0 for each in plant.inputs}


def sine_excitation(
    plant: AbstractPlant | type[AbstractPlant],
    table: ParameterTable,
    frequency: NDArray[np.float64],
    amplitudes: Mapping[str, float],
) -> Excitation:
    """Sines of ``amplitudes`` [unit of each input], by name, at D frequencies [Hz], about rest; other inputs rest."""
    harmonics = {}
    for name, rest in resting_values(plant, table).items():
        row = [rest, amplitudes[name]] if name in amplitudes else [rest]
        harmonics[name] = jnp.asarray(np.tile(np.array(row, np.complex128), (frequency.size, 1)))
    return Excitation(jnp.asarray(frequency), harmonics)


def interpolate_excitation(excitation: Excitation) -> Excitation:
    """As many frequencies again, in the widest gaps on a logarithmic axis."""
    known = np.asarray(excitation.frequency)
    added = bisect_widest_gaps(known, known.size)

    def interpolated(values: object) -> NDArray[np.complex128]:
        columns = np.asarray(values).T
        parts = [
            np.interp(added, known, column.real) + 1j * np.interp(added, known, column.imag)
            for column in columns
        ]
        return np.stack(parts, axis=1)

    harmonics = {name: jnp.asarray(interpolated(values)) for name, values in excitation.harmonics.items()}
    return Excitation(jnp.asarray(added), harmonics)


def bisect_widest_gaps(known: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """``count`` frequencies, each in the middle of what is then the widest gap; growing.

    ``known`` (D,) grows; a single one has no gap and is followed at one per cent.
    """
    points = list(np.log(known)) if known.size > 1 else [*np.log(known), *(np.log(known) + 0.01)]
    added = []
    for _ in range(count):
        gap = int(np.argmax(np.diff(points)))
        middle = 0.5 * (points[gap] + points[gap + 1])
        points.insert(gap + 1, middle)
        added.append(middle)
    return np.asarray(np.exp(np.sort(added)))


def recorded_names(plant: AbstractPlant | type[AbstractPlant]) -> tuple[str, ...]:
    """The channels of a recording that a plant takes or gives: its inputs, then what its sensors read."""
    return (*(each.name for each in plant.inputs), *(each.name for each in plant.channels))


def measured_excitation(
    plant: AbstractPlant | type[AbstractPlant], measured: HarmonicResponse, table: ParameterTable
) -> Excitation:
    """The inputs of the tests as they were recorded, harmonics that stand out of their noise.

    An input that was not recorded, and need not be, rests at the value that ``table`` has for it. Raises
    :class:`InputError` if an input that is required was not recorded.
    """
    harmonics = {each.name: jnp.asarray(_recorded(each, measured, table)) for each in plant.inputs}
    return Excitation(jnp.asarray(measured.frequency), harmonics)


def _recorded(given: Input, measured: HarmonicResponse, table: ParameterTable) -> NDArray[np.complex128]:
    rest = table[given.rest].value if given.rest else 0.0
    if given.name not in measured.channels:
        if given.required:
            raise InputError(
                f"the {given.about} was not recorded",
                channel=given.name,
                remedy="map its channel in channels.toml",
            )
        return np.full((measured.frequency.size, 1), rest, dtype=np.complex128)
    place = measured.channel(given.name)
    harmonics = measured.harmonics[:, place].copy()
    variance = np.trace(measured.covariance[:, place], axis1=-2, axis2=-1)
    stands_out = np.abs(harmonics) ** 2 > SIGNIFICANT**2 * variance
    stands_out[:, 0] = True
    valid = measured.valid[:, place]
    harmonics[~(stands_out & valid)] = 0.0
    if given.keeps_mean:
        harmonics[~valid[:, 0], 0] = rest
    else:
        harmonics[:, 0] = 0.0
    return harmonics if given.orders is None else harmonics[:, : given.orders + 1]


_FIELDS = (
    "frequency", "frequency_sd", "harmonics", "covariance", "valid", "peak_to_peak", "peak_to_peak_sd",
    "noise_sd", "periods",
)  # fmt: skip


def up_to_frequency(response: HarmonicResponse, highest: float | None) -> HarmonicResponse:
    """The dwells up to ``highest`` [Hz], all of them if it is None.

    Raises :class:`InputError` if none is left.
    """
    if highest is None:
        return response
    kept = np.flatnonzero(response.frequency <= highest * (1.0 + 1e-3))
    if kept.size == 0:
        raise InputError(
            f"no dwell is at {highest:g} Hz or below",
            source="--max-frequency",
            remedy=f"the slowest dwell is at {response.frequency[0]:.3g} Hz",
        )
    return _only(response, kept)


def every_so_many(response: HarmonicResponse, step: int) -> HarmonicResponse:
    """Every ``step``-th dwell, the last one among them: it is the fastest."""
    count = response.frequency.size
    return _only(response, np.arange((count - 1) % step, count, step))


def _only(response: HarmonicResponse, kept: NDArray[np.int64]) -> HarmonicResponse:
    dof, recorded = response.covariance_dof, response.recorded
    return replace(
        response,
        tests=tuple(response.tests[d] for d in kept),
        covariance_dof=None if dof is None else dof[kept],
        recorded=None if recorded is None else recorded[kept],
        **{name: getattr(response, name)[kept] for name in _FIELDS},
    )


Measurements = Campaign | HarmonicResponse
"""What a model is held against: recordings, or the response of their dwells."""


def campaign_of(measured: Measurements) -> Campaign | None:
    """The recordings, where they are known."""
    return measured if isinstance(measured, Campaign) else None


def measured_response(
    measured: Measurements,
    plant: AbstractPlant | type[AbstractPlant],
    orders: int,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
) -> HarmonicResponse:
    """The response of the dwells up to ``max_frequency`` [Hz], orders 0..``orders``, in the channels of ``plant``.

    A response that is given stays as it is but for the dwells that are left out. Raises :class:`InputError` if no
    dwell can be used or none is that slow.
    """
    if isinstance(measured, HarmonicResponse):
        return up_to_frequency(measured, max_frequency)
    progress("estimating responses")
    only = measured.only(recorded_names(plant))
    return up_to_frequency(estimate_response(only, orders, plant.inputs[0].name), max_frequency)


def first_sweep(
    campaign: Campaign, plant: AbstractPlant | type[AbstractPlant]
) -> tuple[SweepResponse | None, tuple[DataWarning, ...]]:
    """The response along the first sweep of a campaign that can be used, if there is one, and all warnings."""
    refused: tuple[DataWarning, ...] = ()
    for recording in campaign.only(recorded_names(plant)).of_kind("sweep"):
        try:
            sweep = estimate_sweep_response(recording, plant.inputs[0].name, source=campaign.source)
        except InputError as error:
            refused += (error.as_warning("sweep_not_used"),)
            continue
        return sweep, (*refused, *sweep.warnings)
    return None, refused
