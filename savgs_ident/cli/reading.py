"""From a campaign on disk to the response that models are held against."""

from pathlib import Path

from savgs_ident.cli.console import Progress
from savgs_ident.cli.selection import up_to_frequency
from savgs_ident.core.errors import InputError
from savgs_ident.recordings.read import read_campaign
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.estimate import estimate_response
from savgs_ident.responses.estimate_sweep import estimate_sweep_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.sweep_response import SweepResponse
from savgs_ident.simulate.measured import MODELLED_CHANNELS


def read_response(
    path: Path, channels: Path | None, orders: int, max_frequency: float | None, progress: Progress
) -> tuple[Campaign, HarmonicResponse]:
    """The campaign, and the response of its dwells up to ``max_frequency`` [Hz], orders 0..``orders``."""
    progress(f"reading {path}")
    campaign = read_campaign(path, channels, progress=progress.fraction(f"reading {path}"))
    progress("estimating responses")
    response = estimate_response(campaign.only(MODELLED_CHANNELS), orders)
    return campaign, up_to_frequency(response, max_frequency)


def first_sweep(campaign: Campaign) -> SweepResponse | None:
    """The response along the first sweep of a campaign; None if there is none that can be used."""
    for recording in campaign.only(MODELLED_CHANNELS).of_kind("sweep"):
        try:
            return estimate_sweep_response(recording, source=campaign.source)
        except InputError:
            continue
    return None
