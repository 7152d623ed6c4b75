"""From a campaign to the responses that models are held against."""

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse
from savgs_ident.responses.selection import up_to_frequency
from savgs_ident.responses.sweeps import estimate_sweep_response
from savgs_ident.simulate.excitation import recorded_names

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
            return estimate_sweep_response(recording, source=campaign.source)
        except InputError:
            continue
    return None
