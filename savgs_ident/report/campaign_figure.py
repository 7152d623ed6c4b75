"""The picture of a campaign: its response to the road, how far each order stands above noise, the noise."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from savgs_ident.report.campaign_summary import CARRIES, CampaignSummary
from savgs_ident.report.readings import READINGS
from savgs_ident.report.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    frequency_axis,
    label_of,
    magnitude_axis,
    new_figure,
    styled,
)
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.signal_to_noise import signal_to_noise
from savgs_ident.responses.sweep_response import SweepResponse

_STEPS = (CARRIES, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)


def campaign_figure(summary: CampaignSummary) -> Figure:
    """Response per metre of road, signal-to-noise by order, and noise; a column for each reading."""
    with styled():
        figure = new_figure(10.5, 9.5)
        figure.suptitle(label_of(f"What is in {summary.campaign.source}"), fontsize=11)
        axes = figure.subplots(3, len(READINGS), squeeze=False, height_ratios=(1.25, 1.0, 0.8))
        span = _span(summary)
        for column, name in zip(axes.T, READINGS, strict=True):
            column[0].set_title(READINGS[name].title)
            _draw_response(column[0], summary, name)
            shades = _draw_ratio(column[1], summary.response, name)
            _draw_noise(column[2], summary, name)
            for row, axis in enumerate(column):
                frequency_axis(axis, *span, labelled=row == 2)
        if shades is not None:
            bar = figure.colorbar(shades, ax=list(axes[1]), aspect=14, pad=0.01)
            bar.set_label(f"signal-to-noise of the order [1] (x: below {CARRIES:g})")
        figure.align_ylabels(axes)
        return figure


def _span(summary: CampaignSummary) -> tuple[float, float]:
    frequencies = [] if summary.response is None else [summary.response.frequency]
    frequencies += [sweep.frequency for sweep in summary.sweeps]
    if not frequencies:
        return 0.5, 6.0
    together = np.concatenate(frequencies)
    return float(together.min()), float(together.max())


def _usable(response: HarmonicResponse | None, name: str) -> bool:
    return response is not None and name in response.channels and "road_height" in response.channels


def _draw_response(axes: Axes, summary: CampaignSummary, name: str) -> None:
    magnitude_axis(axes)
    axes.set_ylabel(f"first harmonic [{READINGS[name].per_road} of road]")
    for sweep in summary.sweeps:
        _draw_sweep(axes, sweep, name)
    response = summary.response
    if response is not None and _usable(response, name):
        d = response.valid[:, response.channel(name), 1]
        first = response.harmonics[d, response.channel(name), 1]
        road = np.abs(response.harmonics[d, response.channel("road_height"), 1])
        error = np.sqrt(0.5 * np.trace(response.covariance[d, response.channel(name), 1], axis1=1, axis2=2))
        axes.errorbar(
            response.frequency[d], np.abs(first) / road, 2.0 * error / road,
            fmt="o", color=INK, markersize=4.5, capsize=2.5, linewidth=1.0, label="dwells, ± 2 sd",
        )  # fmt: skip
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")
    else:
        axes.text(0.5, 0.5, "not recorded", transform=axes.transAxes, ha="center", color=GREY)


def _draw_sweep(axes: Axes, sweep: SweepResponse, name: str) -> None:
    if name not in sweep.channels:
        return
    c = sweep.channel(name)
    kept = sweep.valid[:, c]
    axes.plot(
        sweep.frequency[kept], np.abs(sweep.response[kept, c]),
        color=ORANGE, linestyle="--", label=label_of(sweep.test),
    )  # fmt: skip


def _draw_ratio(axes: Axes, response: HarmonicResponse | None, name: str) -> ScalarMappable | None:
    axes.set_ylabel("harmonic order [1]")
    axes.grid(visible=False)
    if response is None or not _usable(response, name):
        return None
    ratio = signal_to_noise(response)[:, response.channel(name), 1:]
    frequency, order = np.broadcast_arrays(response.frequency[:, None], np.arange(1, ratio.shape[1] + 1))
    valid = response.valid[:, response.channel(name), 1:]
    buried, seen = valid & (ratio < CARRIES), valid & (ratio >= CARRIES)
    axes.set_ylim(0.2, ratio.shape[1] + 0.8)
    axes.yaxis.set_major_locator(MultipleLocator(2, offset=1))
    axes.scatter(frequency[buried], order[buried], s=5, marker="x", linewidths=0.6, color=GREY)
    return axes.scatter(
        frequency[seen], order[seen], c=ratio[seen], norm=BoundaryNorm(_STEPS, 256, extend="max"),
        cmap="cividis_r", marker="s", s=26, linewidths=0.3, edgecolors=GREY,
    )  # fmt: skip


def _draw_noise(axes: Axes, summary: CampaignSummary, name: str) -> None:
    unit, scale = READINGS[name].unit, READINGS[name].scale
    axes.set_ylabel(f"noise of a sample [{unit}]")
    response = summary.response
    if response is not None and _usable(response, name):
        noise = scale * response.noise_sd[:, response.channel(name)]
        axes.plot(response.frequency, noise, "D", color=BLUE, markersize=4, label="in the dwell, 1 sd")
    at_rest = summary.standstill_noise.get(name)
    if at_rest is not None:
        axes.axhline(scale * at_rest, color=INK, linestyle="--", linewidth=1.2, label="at standstill")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower left", ncols=2)
    axes.set_ylim(0.0, 1.2 * max(axes.dataLim.y1, np.finfo(float).tiny))
