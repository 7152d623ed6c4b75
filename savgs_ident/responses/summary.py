"""What is in a campaign: responses of dwells and sweeps, the noise at rest, and what is wrong with it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse
from savgs_ident.responses.outliers import estimate_standstill_noise
from savgs_ident.responses.sweeps import estimate_sweep_response

LEAST_RATIO = 3.0
"""Least signal-to-noise ratio [1] of an order that counts as seen."""


@dataclass(frozen=True)
class CampaignSummary(Result):
    """A campaign and what was made of it.

    ``response`` is None where no dwell can be used; ``sweeps`` hold the responses of the sensors;
    ``standstill_noise`` is the standard deviation of each channel at rest [its unit], empty without a record;
    ``warnings`` are those of reading and of estimation together.
    """

    presenter: ClassVar[str] = "CAMPAIGN_SUMMARY"

    campaign: Campaign
    response: HarmonicResponse | None
    sweeps: tuple[SweepResponse, ...]
    standstill_noise: dict[str, float]
    warnings: tuple[DataWarning, ...]


def inspect(
    campaign: Campaign,
    channels: Sequence[str] = (),
    orders: int = 15,
    progress: Progress = no_progress,
) -> CampaignSummary:
    """What is in a campaign: tests, channels, amplitudes, signal-to-noise, noise, warnings.

    What can be estimated is, harmonics up to ``orders``, of sweeps the response of ``channels``, of those of
    the campaign's layout where none is given; what cannot be becomes a warning.
    """
    progress("estimating responses")
    warnings = list(campaign.warnings)
    response = None
    if campaign.of_kind("dwell"):
        try:
            response = estimate_response(campaign, orders)
            warnings += response.warnings
        except InputError as error:
            warnings.append(error.as_warning("no_usable_dwell"))
    else:
        what = "there is no harmonic dwell: a road, a sweep or a motion along its drive is compared instead"
        warnings.append(
            DataWarning(
                "no_dwell",
                what,
                campaign.source,
                remedy="none needed, unless some are: name these dwell_<f>Hz",
            )
        )
    driven = campaign.layout.driven
    wanted = (driven, *(channels or campaign.layout.responses))
    sweeps = []
    for recording in campaign.of_kind("sweep"):
        try:
            sweeps.append(estimate_sweep_response(_only(recording, wanted), driven, source=campaign.source))
        except InputError as error:
            warnings.append(error.as_warning("sweep_not_used"))
    warnings += [warning for sweep in sweeps for warning in sweep.warnings]
    noise, found = estimate_standstill_noise(campaign)
    warnings += found
    return CampaignSummary(campaign, response, tuple(sweeps), noise, tuple(dict.fromkeys(warnings)))


def _only(recording: Recording, channels: Sequence[str]) -> Recording:
    found = {name: channel for name, channel in recording.channels.items() if name in channels}
    return Recording(recording.name, recording.kind, recording.frequency_hz, found)
