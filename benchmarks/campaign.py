"""The shipped campaign, cut down to the dwells that a run works on."""

from collections.abc import Sequence
from dataclasses import replace

from benchmarks.task import ORDERS
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import default_campaign_path
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.compared_tests import recorded_names


def read_dwells(dwells_hz: Sequence[float]) -> Campaign:
    """The campaign without the dwells that were asked for at other frequencies [Hz] than these."""
    campaign = load_campaign(default_campaign_path())

    def kept(recording: Recording) -> bool:
        return recording.kind != "dwell" or recording.frequency_hz in dwells_hz

    return replace(campaign, recordings=tuple(filter(kept, campaign.recordings)))


def response_of(campaign: Campaign) -> HarmonicResponse:
    """Its response, as the commands estimate it."""
    return estimate_response(campaign.only(recorded_names(QuarterCar)), ORDERS)
