"""Tests that do not repeat, as they were recorded: how large each channel is in them, over time and by frequency.

A road, a sweep, a step or the motion of an axis has no harmonics of its own to list; what shows whether it was read
as it was meant is its size in its unit, its course and its spectrum.
"""

from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import RenderableType
from scipy.signal import welch

from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording, RecordingLayout
from savgs_ident.report.text import fixed, shown_unit, significant, table
from savgs_ident.report.theme import (
    BLUE,
    INK,
    ORANGE,
    frequency_axis,
    magnitude_axis,
    new_figure,
    printable,
    styled,
)

COLUMNS = 900
"""Stretches into which a course is divided that is drawn: of each its least and its largest value."""

SEGMENTS = 8
"""Halves of a stretch of a spectrum that fit into a test."""

LINES = (BLUE, ORANGE, INK)
"""Colours of the tests whose spectra are drawn, the longest first."""


def moving_tests(campaign: Campaign) -> list[Recording]:
    """The tests that are neither dwells nor standstills, the longest first."""
    others = [each for each in campaign.recordings if each.kind not in ("dwell", "standstill")]
    return sorted(others, key=lambda each: -each.duration_s)


def motion_records(campaign: Campaign) -> list[dict[str, object]]:
    """What each of them holds, in the order of the recordings; SI, sizes about the mean."""
    kept = {each.name for each in moving_tests(campaign)}
    return [
        {
            "test": each.name,
            "kind": each.kind,
            "duration_s": each.duration_s,
            "channels": {name: _sizes(channel) for name, channel in each.channels.items()},
        }
        for each in campaign.recordings
        if each.name in kept
    ]


def _sizes(channel: RecordedChannel) -> dict[str, object]:
    about = channel.values - np.mean(channel.values)
    return {
        "unit": channel.unit,
        "mean": float(np.mean(channel.values)),
        "rms": float(np.sqrt(np.mean(about**2))),
        "largest": float(np.max(np.abs(about))),
    }


def motion_table(motions: list[dict[str, Any]], layout: RecordingLayout) -> RenderableType:
    """How large every channel is in every one of them; of ``motions`` as the record has them."""
    rows = []
    for each in motions:
        for place, (name, sizes) in enumerate(each["channels"].items()):
            unit, scale = shown_unit(sizes["unit"])
            first = (each["test"], each["kind"], fixed(each["duration_s"], 1)) if place == 0 else ("", "", "")
            found = (significant(scale * sizes[key], 3) for key in ("mean", "rms", "largest"))
            rows.append(
                (*first, layout.specs[name].short or name if name in layout.specs else name, *found, unit)
            )
    headers = (
        "test",
        "kind",
        "time\n[s]",
        "channel",
        "mean",
        "rms about\nthe mean",
        "largest\nabout it",
        "unit",
    )
    return table("Tests that do not repeat", headers, rows, texts=(0, 1, 3, 7))


def motions_figure(campaign: Campaign) -> Figure:
    """The course of the longest of them, and spectra of the three longest; a row for each channel of the plant."""
    tests, layout = moving_tests(campaign)[: len(LINES)], campaign.layout
    names = [name for name in layout.names if any(name in each.channels for each in tests)]
    with styled():
        figure = new_figure(10.5, 1.2 + 2.1 * max(len(names), 1))
        figure.suptitle(printable(f"What is in {campaign.source}"), fontsize=11)
        axes = figure.subplots(max(len(names), 1), 2, squeeze=False, sharex="col", width_ratios=(1.6, 1.0))
        for row, name in zip(axes, names, strict=False):
            unit, scale = shown_unit(layout.specs[name].unit)
            row[0].set_ylabel(f"{fill(printable(layout.specs[name].about), 24)}\n[{unit}]")
            row[1].set_ylabel(f"[{unit}/√Hz]")
            magnitude_axis(row[1])
            _draw_course(row[0], tests[0].channels.get(name), scale)
            for test, colour in zip(tests, LINES, strict=False):
                _draw_spectrum(row[1], test.channels.get(name), scale, colour, test.name)
        axes[0, 0].set_title(printable(f"course of {tests[0].name}"))
        axes[0, 1].set_title("amplitude spectral density")
        axes[-1, 0].set_xlabel("time since the first sample [s]")
        fastest = 0.5 * max(channel.rate_hz for each in tests for channel in each.channels.values())
        slowest = max(2.0 / tests[0].duration_s, 1e-3 * fastest)
        for place, axis in enumerate(axes[:, 1]):
            frequency_axis(axis, slowest, fastest, labelled=place == len(axes) - 1)
        if len(tests) > 1:
            axes[0, 1].legend(loc="best", fontsize=7)
        figure.align_ylabels(axes)
        return figure


def _draw_course(axes: Axes, channel: RecordedChannel | None, scale: float) -> None:
    if channel is None:
        return
    time, values = channel.time - channel.time[0], scale * channel.values
    if time.size <= 2 * COLUMNS:
        axes.plot(time, values, color=BLUE, linewidth=0.8)
        return
    ends = np.linspace(0, time.size, COLUMNS + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, ends), np.maximum.reduceat(values, ends)
    axes.fill_between(time[ends], low, high, color=BLUE, linewidth=0.5)


def _draw_spectrum(
    axes: Axes, channel: RecordedChannel | None, scale: float, colour: str, label: str
) -> None:
    if channel is None or channel.values.size < 2 * SEGMENTS:
        return
    frequency, density = _spectrum(channel)
    axes.plot(frequency, scale * density, color=colour, linewidth=0.9, label=printable(label))


def _spectrum(channel: RecordedChannel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz] and amplitude spectral density [unit/sqrt(Hz)] of a channel, on an even grid of its rate."""
    rate = channel.rate_hz
    grid = np.arange(channel.time[0], channel.time[-1], 1.0 / rate)
    values = np.interp(grid, channel.time, channel.values)
    frequency, power = welch(values, rate, nperseg=max(grid.size // (SEGMENTS // 2), SEGMENTS))
    return frequency[1:], np.sqrt(power[1:])
