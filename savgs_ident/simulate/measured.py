"""From a campaign to the responses that models are held against.

The part of a response that a command is asked to look at.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse
from savgs_ident.responses.sweeps import estimate_sweep_response
from savgs_ident.simulate.excitation import recorded_names

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
    dof = None if response.covariance_dof is None else response.covariance_dof[kept]
    return replace(
        response,
        tests=tuple(response.tests[d] for d in kept),
        covariance_dof=dof,
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


def first_sweep(campaign: Campaign, plant: AbstractPlant | type[AbstractPlant]) -> SweepResponse | None:
    """The response along the first sweep of a campaign; None if there is none that can be used."""
    for recording in campaign.only(recorded_names(plant)).of_kind("sweep"):
        try:
            return estimate_sweep_response(recording, plant.inputs[0].name, source=campaign.source)
        except InputError:
            continue
    return None
