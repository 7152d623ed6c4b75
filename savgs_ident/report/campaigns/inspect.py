"""What is in a campaign: the JSON object of ``inspect.json``, tables and a figure.

Tests, channels, amplitudes, signal-to-noise ratios, noise and warnings; SI throughout, the unit in the key or beside
the value.
"""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray
from rich.console import Group, RenderableType

from savgs_ident.core.files import warning_record
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording, RecordingLayout
from savgs_ident.report.campaigns.motions import motion_records, motion_table
from savgs_ident.report.text import (
    ChannelLabel,
    counted,
    first_of_each_kind,
    fixed,
    plain,
    response_labels,
    shown_unit,
    significant,
    table,
)
from savgs_ident.report.theme import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    frequency_axis,
    magnitude_axis,
    new_figure,
    printable,
    styled,
)
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse, signal_to_noise
from savgs_ident.responses.programmes import driven_alike, settings_of
from savgs_ident.responses.summary import LEAST_RATIO, CampaignSummary


def summary_record(summary: CampaignSummary) -> dict[str, object]:
    """The JSON object of ``inspect``."""
    campaign = summary.campaign
    return {
        "schema": 1,
        "source": campaign.source,
        "sha256": campaign.sha256,
        "tests": len(campaign.recordings),
        "channels": _channels(campaign, summary.standstill_noise),
        "missing_channels": [name for name in campaign.layout.names if name not in _present(campaign)],
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
        "motions": motion_records(campaign),
        "warnings": [warning_record(warning) for warning in summary.warnings],
    }


def _present(campaign: Campaign) -> dict[str, list[RecordedChannel]]:
    """The records of each channel by name, those of the layout first."""
    found: dict[str, list[RecordedChannel]] = {name: [] for name in campaign.layout.names}
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
        | _dwell_response(summary.response, recording, used.get(recording.name))
        for recording in ordered
    ]


def _dwell_response(
    response: HarmonicResponse | None, recording: Recording, d: int | None
) -> dict[str, object]:
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
            "orders_seen": [k for k in range(1, response.orders + 1) if ratio[c, k] >= LEAST_RATIO],
            "unit": recording.channels[name].unit,
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


_SHOWN_WARNINGS = 20


def campaign_text(record: dict[str, Any], layout: RecordingLayout) -> RenderableType:
    """Tables of channels and dwells, the other tests, and the warnings of an ``inspect`` record."""
    parts: list[RenderableType] = [plain(f"{record['source']}: {counted(record['tests'], 'test')}", "bold")]
    parts.append(_channel_table(record))
    if record["missing_channels"]:
        parts.append(plain("Not recorded: " + ", ".join(record["missing_channels"]) + "\n"))
    if record["dwells"]:
        parts.append(_dwell_table(record["dwells"], layout))
    if record["motions"]:
        parts.append(motion_table(record["motions"], layout))
    parts += [plain(line) for line in _other_tests(record)]
    parts += _warnings(record["source"], record["warnings"])
    return Group(*parts)


def _channel_table(record: dict[str, Any]) -> RenderableType:
    rows = [
        (
            channel["name"],
            channel["unit"],
            significant(channel["rate_hz"]),
            channel["samples"],
            channel["tests"],
            significant(channel["standstill_noise"], 3),
            channel["recorded_as"] or "-",
        )
        for channel in record["channels"]
    ]
    headers = ("channel", "unit", "rate\n[Hz]", "samples", "tests", "noise at rest\n(1 sd)", "recorded as")
    return table("Channels", headers, rows, texts=(0, 1, 6))


def _dwell_table(dwells: list[dict[str, Any]], layout: RecordingLayout) -> RenderableType:
    driven = layout.specs[layout.driven]
    shown, scale = shown_unit(driven.unit)
    labels = response_labels(layout)
    rows = [
        (
            dwell["test"],
            fixed(dwell["frequency_hz"], 3),
            dwell["periods"] or "-",
            _reading(dwell, driven.name, "peak_to_peak", scale, 2),
            *(cell for name, label in labels.items() for cell in _response_cells(dwell, name, label)),
        )
        for dwell in dwells
    ]
    headers = ["dwell", "f\n[Hz]", "periods", f"{driven.short or driven.name}\n[{shown}]"]
    for name, label in labels.items():
        headers += [f"{layout.specs[name].short or name}\n[{label.unit}]", "S/N\n[1]", "order"]
    title = "Dwells, peak to peak (S/N: signal-to-noise of the first harmonic; order: highest one seen)"
    return table(title, headers, rows)


def _response_cells(dwell: dict[str, Any], name: str, label: ChannelLabel) -> tuple[str, ...]:
    return (
        _reading(dwell, name, "peak_to_peak", label.scale, 3 if label.scale == 1.0 else 2),
        _reading(dwell, name, "signal_to_noise", 1.0, 0),
        _highest(dwell, name),
    )


def _reading(dwell: dict[str, Any], channel: str, key: str, scale: float, places: int) -> str:
    entry = dwell["channels"].get(channel)
    return "-" if entry is None else fixed(scale * float(entry[key]), places)


def _highest(dwell: dict[str, Any], channel: str) -> str:
    seen = dwell["channels"].get(channel, {}).get("orders_seen")
    return str(seen[-1]) if seen else "-"


def _other_tests(record: dict[str, Any]) -> list[str]:
    lines = []
    for sweep in record["sweeps"]:
        span = sweep["frequency_hz"]
        band = f", response from {span[0]:.2f} to {span[1]:.2f} Hz" if span else ""
        lines.append(f"Sweep {sweep['test']}: {sweep['duration_s']:.1f} s{band}")
    lines += [f"Standstill {each['test']}: {each['duration_s']:.1f} s" for each in record["standstills"]]
    return lines


def _warnings(source: str, warnings: list[dict[str, Any]]) -> list[RenderableType]:
    if not warnings:
        return [plain("No warnings.")]
    # The heading names the source already.
    lines = first_of_each_kind(
        (
            each["code"],
            each["channel"] or "",
            each["message"].replace(f"] {source}, ", "] ").replace(f"] {source}: ", "] "),
        )
        for each in warnings
    )
    shown: list[RenderableType] = [plain(counted(len(warnings), "warning"), "bold")]
    shown += [plain(line) for line in lines[:_SHOWN_WARNINGS]]
    if len(lines) < len(warnings) or len(lines) > _SHOWN_WARNINGS:
        shown.append(plain("All of them are in inspect.json."))
    return shown


_COLUMN = 4.6
"""Width of a column [in]."""

_MARKERS = "os^Dv<>p"
"""Of the programmes of a campaign, one after the other."""

_STEPS = (LEAST_RATIO, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)


def campaign_figure(summary: CampaignSummary) -> Figure:
    """Response per metre of road, signal-to-noise by order, and noise; a column for each response."""
    with styled():
        labels = response_labels(summary.campaign.layout)
        figure = new_figure(max(_COLUMN * len(labels) + 1.3, 7.5), 9.5)
        figure.suptitle(printable(f"What is in {summary.campaign.source}"), fontsize=11)
        axes = figure.subplots(3, len(labels), squeeze=False, height_ratios=(1.25, 1.0, 0.8))
        span = _span(summary)
        for column, (name, label) in zip(axes.T, labels.items(), strict=True):
            column[0].set_title(label.title)
            _draw_response(column[0], summary, name, label)
            shades = _draw_ratio(column[1], summary, name)
            _draw_noise(column[2], summary, name, label)
            for row, axis in enumerate(column):
                frequency_axis(axis, *span, labelled=row == 2)
        if shades is not None:
            bar = figure.colorbar(shades, ax=list(axes[1]), aspect=14, pad=0.01)
            bar.set_label(f"signal-to-noise of the order [1] (x: below {LEAST_RATIO:g})")
        figure.align_ylabels(axes)
        return figure


def _span(summary: CampaignSummary) -> tuple[float, float]:
    frequencies = [] if summary.response is None else [summary.response.frequency]
    frequencies += [sweep.frequency for sweep in summary.sweeps]
    if not frequencies:
        return 0.5, 6.0
    together = np.concatenate(frequencies)
    return float(together.min()), float(together.max())


def _usable(summary: CampaignSummary, name: str) -> HarmonicResponse | None:
    """The response of the dwells if the channel and the driven one are in it."""
    response = summary.response
    if response is None or not {name, summary.campaign.layout.driven} <= set(response.channels):
        return None
    return response


def _draw_response(axes: Axes, summary: CampaignSummary, name: str, label: ChannelLabel) -> None:
    magnitude_axis(axes)
    axes.set_ylabel(f"first harmonic [{label.per_input} of {label.input}]")
    for sweep in summary.sweeps:
        _draw_sweep(axes, sweep, name)
    response = _usable(summary, name)
    if response is not None:
        d = response.valid[:, response.channel(name), 1]
        first = response.harmonics[d, response.channel(name), 1]
        road = np.abs(response.harmonics[d, response.channel(summary.campaign.layout.driven), 1])
        error = np.sqrt(0.5 * np.trace(response.covariance[d, response.channel(name), 1], axis1=1, axis2=2))
        programme, label_of_dwells = _programmes(summary, response)[d], "dwells, ± 2 sd"
        for each in np.unique(programme):
            mine = programme == each
            axes.errorbar(
                response.frequency[d][mine], (np.abs(first) / road)[mine], (2.0 * error / road)[mine],
                fmt=_MARKERS[each % len(_MARKERS)], color=INK, markersize=4.5, capsize=2.5, linewidth=1.0,
                markerfacecolor=INK if each == 0 else "white", label=label_of_dwells,
            )  # fmt: skip
            label_of_dwells = "_nolegend_"
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")
    else:
        axes.text(0.5, 0.5, "not recorded", transform=axes.transAxes, ha="center", color=GREY)


def _programmes(summary: CampaignSummary, response: HarmonicResponse) -> NDArray[np.intp]:
    """The programme of each dwell, (D,), by amplitudes of what is driven and levels of what is no response either."""
    layout = summary.campaign.layout
    levels = [
        name for name in response.channels if name not in (layout.driven, *layout.responses, *layout.free)
    ]
    first = response.harmonics[:, response.channel(layout.driven), 1]
    means = [response.harmonics[:, response.channel(name), 0] for name in levels]
    return driven_alike(response.frequency, settings_of(first, means))


def _draw_sweep(axes: Axes, sweep: SweepResponse, name: str) -> None:
    if name not in sweep.channels:
        return
    c = sweep.channel(name)
    kept = sweep.valid[:, c]
    axes.plot(
        sweep.frequency[kept], np.abs(sweep.response[kept, c]),
        color=ORANGE, linestyle="--", label=printable(sweep.test),
    )  # fmt: skip


def _draw_ratio(axes: Axes, summary: CampaignSummary, name: str) -> ScalarMappable | None:
    axes.set_ylabel("harmonic order [1]")
    axes.grid(visible=False)
    response = _usable(summary, name)
    if response is None:
        return None
    ratio = signal_to_noise(response)[:, response.channel(name), 1:]
    frequency, order = np.broadcast_arrays(response.frequency[:, None], np.arange(1, ratio.shape[1] + 1))
    valid = response.valid[:, response.channel(name), 1:]
    buried, seen = valid & (ratio < LEAST_RATIO), valid & (ratio >= LEAST_RATIO)
    axes.set_ylim(0.2, ratio.shape[1] + 0.8)
    axes.yaxis.set_major_locator(MultipleLocator(2, offset=1))
    axes.scatter(frequency[buried], order[buried], s=5, marker="x", linewidths=0.6, color=GREY)
    return axes.scatter(
        frequency[seen], order[seen], c=ratio[seen], norm=BoundaryNorm(_STEPS, 256, extend="max"),
        cmap="cividis_r", marker="s", s=26, linewidths=0.3, edgecolors=GREY,
    )  # fmt: skip


def _draw_noise(axes: Axes, summary: CampaignSummary, name: str, label: ChannelLabel) -> None:
    unit, scale = label.unit, label.scale
    axes.set_ylabel(f"noise of a sample [{unit}]")
    response = _usable(summary, name)
    if response is not None:
        noise = scale * response.noise_sd[:, response.channel(name)]
        axes.plot(response.frequency, noise, "D", color=BLUE, markersize=4, label="in the dwell, 1 sd")
    at_rest = summary.standstill_noise.get(name)
    if at_rest is not None:
        axes.axhline(scale * at_rest, color=INK, linestyle="--", linewidth=1.2, label="at standstill")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower left", ncols=2)
    axes.set_ylim(0.0, 1.2 * max(axes.dataLim.y1, np.finfo(float).tiny))
