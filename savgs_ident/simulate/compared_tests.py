"""What of a campaign a model is held against: the response of its dwells, and of its other tests in windows.

Beside dwells roads are looked at in windows, and where there are none sweeps and other tests, too.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.plants.base import AbstractPlant, scale_of_time
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse
from savgs_ident.responses.selection import join_tests, only_tests
from savgs_ident.responses.sweeps import estimate_sweep_response
from savgs_ident.responses.windows import (
    BESIDE_DWELLS,
    KINDS,
    MOST_HZ,
    estimate_windows,
)

Measurements = Campaign | HarmonicResponse
"""What a model is held against: recordings, or the response of their dwells."""


def campaign_of(measured: Measurements) -> Campaign | None:
    """The recordings, where they are known."""
    return measured if isinstance(measured, Campaign) else None


def recorded_names(plant: AbstractPlant | type[AbstractPlant]) -> tuple[str, ...]:
    """The channels of a recording that a plant takes or gives: its inputs, then what its sensors read."""
    return (*(each.name for each in plant.inputs), *(each.name for each in plant.channels))


def up_to_frequency(response: HarmonicResponse, highest: float | None) -> HarmonicResponse:
    """The dwells up to ``highest`` [Hz], all of them if it is None, and windows as they are.

    Raises :class:`InputError` if there are dwells and none is left.
    """
    if highest is None or not response.dwells.size:
        return response
    slow = response.dwells[response.frequency[response.dwells] <= highest * (1.0 + 1e-3)]
    if slow.size == 0:
        raise InputError(
            f"no dwell is at {highest:g} Hz or below",
            source="--max-frequency",
            remedy=f"the slowest dwell is at {response.frequency[0]:.3g} Hz",
        )
    return only_tests(response, np.concatenate([slow, response.windows]))


def every_so_many(response: HarmonicResponse, step: int) -> HarmonicResponse:
    """Every ``step``-th dwell, the last one among them: it is the fastest."""
    count = response.frequency.size
    return only_tests(response, np.arange((count - 1) % step, count, step))


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
    only = _with_inputs(measured, plant).only((*recorded_names(plant), *measured.layout.free))
    return up_to_frequency(estimate_response(only, orders, plant.inputs[0].name), max_frequency)


def response_of_tests(
    measured: Measurements,
    plant: AbstractPlant | type[AbstractPlant],
    orders: int,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
    cut: Callable[..., HarmonicResponse] = estimate_windows,
) -> HarmonicResponse:
    """The same, and beside dwells that of roads, in windows; without dwells that of sweeps and other tests, too.

    Windows are those that ``cut`` makes of the campaign, its inputs and readings, up to ``max_frequency`` [Hz] or the
    usual one, of tests of some ``kinds``. With a warning where roads beside dwells cannot be used.
    """
    if isinstance(measured, HarmonicResponse):
        return measured_response(measured, plant, orders, max_frequency, progress)
    dwells = bool(measured.of_kind("dwell")) or not any(measured.of_kind(kind) for kind in KINDS)
    kinds = BESIDE_DWELLS if dwells else KINDS
    if not any(measured.of_kind(kind) for kind in kinds):
        return measured_response(measured, plant, orders, max_frequency, progress)
    response = measured_response(measured, plant, orders, max_frequency, progress) if dwells else None
    progress("cutting windows")
    scale = scale_of_time(plant)
    inputs, readings = ([each.name for each in listed] for listed in (plant.inputs, plant.channels))
    # Beside dwells their limit is given for them: windows keep within theirs.
    highest = min(max_frequency, MOST_HZ / scale) if dwells and max_frequency is not None else max_frequency
    only = _with_inputs(measured, plant).only((*recorded_names(plant), *measured.layout.free))
    try:
        windows = cut(only, inputs, readings, highest, kinds=kinds, time_scale=scale)
    except InputError as error:
        if response is None:
            raise
        return replace(response, warnings=(*response.warnings, error.as_warning("tests_not_used")))
    return windows if response is None else join_tests(response, windows)


def _with_inputs(campaign: Campaign, plant: AbstractPlant | type[AbstractPlant]) -> Campaign:
    """The campaign without tests that lack an input which others have and the plant requires."""
    moving = [each for each in campaign.recordings if each.kind != "standstill"]
    known = [
        each.name
        for each in plant.inputs
        if each.required and any(each.name in one.channels for one in moving)
    ]
    kept = tuple(
        each
        for each in campaign.recordings
        if each.kind == "standstill"
        or all(
            name in each.channels for name in known if each.kind != "decay" or name != plant.inputs[0].name
        )
    )
    return replace(campaign, recordings=kept)


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
