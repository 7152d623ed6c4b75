"""What is in a campaign, as one record: tests, channels, amplitudes, signal-to-noise, noise, warnings.

The record is what ``inspect`` writes to ``inspect.json``, shows as tables and draws; SI throughout, the unit
in the key or beside the value.
"""

from dataclasses import dataclass

import numpy as np

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import CANONICAL_UNITS, Campaign, Channel, Recording
from savgs_ident.report.readings import READINGS
from savgs_ident.responses.estimate import estimate_response
from savgs_ident.responses.estimate_sweep import ROAD, estimate_sweep_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.signal_to_noise import signal_to_noise
from savgs_ident.responses.sweep_response import SweepResponse

CARRIES = 3.0
"""Signal-to-noise from which an order counts as seen."""

_FEWEST_SAMPLES = 16


@dataclass(frozen=True)
class CampaignSummary:
    """A campaign and what was made of it.

    ``response`` is None where no dwell can be used; ``sweeps`` hold the response of :data:`READINGS`;
    ``standstill_noise`` is the standard deviation of each channel at rest [its unit], empty without a record;
    ``warnings`` are those of reading and of estimation together.
    """

    campaign: Campaign
    response: HarmonicResponse | None
    sweeps: tuple[SweepResponse, ...]
    standstill_noise: dict[str, float]
    warnings: tuple[DataWarning, ...]


def summarise_campaign(campaign: Campaign, orders: int = 15) -> CampaignSummary:
    """Estimate what can be estimated; whatever cannot becomes a warning."""
    warnings = list(campaign.warnings)
    response = None
    if campaign.of_kind("dwell"):
        try:
            response = estimate_response(campaign, orders)
            warnings += response.warnings
        except InputError as error:
            warnings.append(_as_warning("no_usable_dwell", error))
    else:
        what = "there is no harmonic dwell, which a fit needs"
        warnings.append(DataWarning("no_dwell", what, campaign.source, remedy="name the tests dwell_<f>Hz"))
    sweeps = []
    for recording in campaign.of_kind("sweep"):
        try:
            sweeps.append(estimate_sweep_response(_readings_only(recording), source=campaign.source))
        except InputError as error:
            warnings.append(_as_warning("sweep_not_used", error))
    warnings += [warning for sweep in sweeps for warning in sweep.warnings]
    return CampaignSummary(
        campaign, response, tuple(sweeps), _standstill_noise(campaign), tuple(dict.fromkeys(warnings))
    )


def summary_record(summary: CampaignSummary) -> dict[str, object]:
    """The JSON object of ``inspect``."""
    campaign = summary.campaign
    return {
        "schema": 1,
        "source": campaign.source,
        "sha256": campaign.sha256,
        "tests": len(campaign.recordings),
        "channels": _channels(campaign, summary.standstill_noise),
        "missing_channels": [name for name in CANONICAL_UNITS if name not in _present(campaign)],
        "dwells": _dwells(summary),
        "sweeps": [
            {
                "test": recording.name,
                "duration_s": recording.duration_s,
                "frequency_hz": _sweep_range(summary, recording.name),
            }
            for recording in campaign.of_kind("sweep")
        ],
        "standstills": [
            {"test": recording.name, "duration_s": recording.duration_s}
            for recording in campaign.of_kind("standstill")
        ],
        "others": [
            {"test": recording.name, "duration_s": recording.duration_s}
            for recording in campaign.of_kind("other")
        ],
        "warnings": [warning_record(warning) for warning in summary.warnings],
    }


def warning_record(warning: DataWarning) -> dict[str, object]:
    """A warning as JSON has it."""
    return {
        "code": warning.code,
        "message": str(warning),
        "test": warning.test or None,
        "channel": warning.channel or None,
        "time_s": warning.time,
        "remedy": warning.remedy or None,
    }


def _present(campaign: Campaign) -> dict[str, list[Channel]]:
    """The records of each channel by name, canonical order first."""
    found: dict[str, list[Channel]] = {name: [] for name in CANONICAL_UNITS}
    for recording in campaign.recordings:
        for name, channel in recording.channels.items():
            found.setdefault(name, []).append(channel)
    return {name: channels for name, channels in found.items() if channels}


def _channels(campaign: Campaign, at_rest: dict[str, float]) -> list[dict[str, object]]:
    return [
        {
            "name": name,
            "unit": channels[0].unit,
            "recorded_as": channels[0].source or None,
            "rate_hz": float(np.median([channel.rate_hz for channel in channels])),
            "samples": sum(channel.values.size for channel in channels),
            "tests": len(channels),
            "standstill_noise": at_rest.get(name),
        }
        for name, channels in _present(campaign).items()
    ]


def _dwells(summary: CampaignSummary) -> list[dict[str, object]]:
    used = {} if summary.response is None else {test: d for d, test in enumerate(summary.response.tests)}
    recordings = summary.campaign.of_kind("dwell")
    ordered = sorted(recordings, key=lambda recording: used.get(recording.name, len(used)))
    return [
        {
            "test": recording.name,
            "asked_hz": recording.frequency_hz,
            "duration_s": recording.duration_s,
            "usable": recording.name in used,
        }
        | _dwell_response(summary.response, used.get(recording.name))
        for recording in ordered
    ]


def _dwell_response(response: HarmonicResponse | None, d: int | None) -> dict[str, object]:
    if response is None or d is None:
        return {"frequency_hz": None, "frequency_sd_hz": None, "periods": None, "channels": {}}
    ratio = signal_to_noise(response)[d]
    channels = {
        name: {
            "amplitude": abs(response.harmonics[d, c, 1]),
            "peak_to_peak": response.peak_to_peak[d, c],
            "peak_to_peak_sd": response.peak_to_peak_sd[d, c],
            "noise_sd": response.noise_sd[d, c],
            "signal_to_noise": ratio[c, 1],
            "orders_seen": [k for k in range(1, response.orders + 1) if ratio[c, k] >= CARRIES],
            "unit": CANONICAL_UNITS.get(name),
        }
        for c, name in enumerate(response.channels)
        if response.valid[d, c, 1]
    }
    return {
        "frequency_hz": response.frequency[d],
        "frequency_sd_hz": response.frequency_sd[d],
        "periods": response.periods[d],
        "channels": channels,
    }


def _sweep_range(summary: CampaignSummary, test: str) -> list[float] | None:
    for sweep in summary.sweeps:
        if sweep.test == test:
            return [float(sweep.frequency[0]), float(sweep.frequency[-1])]
    return None


def _readings_only(recording: Recording) -> Recording:
    kept = {name: channel for name, channel in recording.channels.items() if name in (ROAD, *READINGS)}
    return Recording(recording.name, recording.kind, recording.frequency_hz, kept)


def _standstill_noise(campaign: Campaign) -> dict[str, float]:
    """Standard deviation of each channel about its trend, the largest over the standstill records."""
    noise: dict[str, float] = {}
    for recording in campaign.of_kind("standstill"):
        for name, channel in recording.channels.items():
            usable = np.isfinite(channel.values)
            if np.count_nonzero(usable) >= _FEWEST_SAMPLES:
                time, values = channel.time[usable], channel.values[usable]
                trend = np.polynomial.Polynomial.fit(time, values, 1)
                noise[name] = max(float(np.std(values - trend(time))), noise.get(name, 0.0))
    return noise


def _as_warning(code: str, error: InputError) -> DataWarning:
    return DataWarning(code, error.what, error.source, error.test, error.channel, error.time, error.remedy)
