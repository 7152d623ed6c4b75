"""Figures of a diagnosis: the map of the gap, and the gap by model and by regime.

The map has one cell for each dwell and harmonic order of a channel, after recalibration: top in noise standard
deviations (is it significant?), bottom in per cent of the channel's response (does it matter?). The colour darkens
steadily, so that it can be read in grey too; what lies within the noise is white, what was not measured is crossed
out.

A regime is a bar as long as the gap there, the most significant on top. Where the misfit is concentrated, the bar is
coloured and has its p-value beside it, so that it is found in grey too.
"""

from collections.abc import Mapping, Sequence
from math import isfinite
from textwrap import wrap
from types import MappingProxyType
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from savgs_ident.diagnosis.gap import MapCell
from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.report.diagnosis.text import (
    LEVEL,
    motion_words,
    p_value_words,
    regimes_sentence,
)
from savgs_ident.report.html import Picture, embed
from savgs_ident.report.text import channel_label
from savgs_ident.report.theme import BLUE, GREY, INK, ORANGE, PALE, new_figure, printable, styled

NOISE = 2.0
"""Up to so many standard deviations a gap is white: it lies within the noise."""

_ROUND = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4)
_STEPS = 6
_LEAST_SIGMA, _LEAST_PERCENT = 100.0, 10.0

_TICK_GAP = 3


def gap_channels(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The channels in the map, in their order there."""
    return tuple(dict.fromkeys(cell.channel for cell in diagnosis.map))


def gap_table(
    cells: Sequence[MapCell], channel: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz] (F,), orders (K,), and the gap in sd and in per cent, (K, F); NaN where there is none."""
    own = [cell for cell in cells if cell.channel == channel]
    frequency = np.array(sorted({cell.frequency_hz for cell in own}))
    orders = np.array(sorted({cell.order for cell in own}), dtype=np.int64)
    sigma, percent = (np.full((orders.size, frequency.size), np.nan) for _ in range(2))
    for cell in own:
        place = (np.searchsorted(orders, cell.order), np.searchsorted(frequency, cell.frequency_hz))
        sigma[place], percent[place] = cell.gap_sigma, cell.gap_percent
    return frequency, orders, sigma, percent


def gap_map_figure(diagnosis: Diagnosis, channel: str) -> Figure:
    """The map of one channel."""
    frequency, orders, sigma, percent = gap_table(diagnosis.map, channel)
    title = channel_label(channel, diagnosis.given).title
    with styled():
        figure = new_figure(4.5, 5.4)
        figure.set_layout_engine("none")
        places = {"left": 0.115, "right": 0.86, "bottom": 0.092, "top": 0.9, "hspace": 0.18}
        above, below = figure.subplots(2, 1, gridspec_kw=places)
        figure.suptitle(printable(title), y=0.985, fontsize=10.0, fontweight="bold")
        _draw(above, frequency, orders, sigma, colour_steps(sigma, NOISE, _LEAST_SIGMA), "gap [noise sd]")
        _draw(
            below,
            frequency,
            orders,
            percent,
            colour_steps(percent, _ROUND[0], _LEAST_PERCENT),
            "gap [% of the response]",
        )
        above.tick_params(axis="x", labelbottom=False)
        below.set_xlabel("frequency of the dwell [Hz]")
        return figure


def colour_steps(values: NDArray[np.float64], first: float, least: float) -> tuple[float, ...]:
    """Where the colour changes: at 0, at ``first``, then at round numbers up to the largest value.

    The scale reaches ``least`` at least, so that a small gap looks small; the last step has no end. Values
    of any shape and any unit, and the steps in the same unit.
    """
    largest = max(float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0)), least)
    beyond = [step for step in _ROUND if first < step <= largest]
    chosen = np.unique(np.linspace(0, len(beyond) - 1, _STEPS).round().astype(int))
    return (0.0, first, *(beyond[place] for place in chosen))


def _draw(
    axes: Axes,
    frequency: NDArray[np.float64],
    orders: NDArray[np.int64],
    values: NDArray[np.float64],
    steps: Sequence[float],
    label: str,
) -> None:
    palette = matplotlib.colormaps["magma_r"](np.linspace(0.08, 0.95, len(steps) - 1))
    colours = ListedColormap([(1.0, 1.0, 1.0, 1.0), *palette])
    axes.set_facecolor("white")
    axes.grid(visible=False)
    _cross_out(axes, np.isnan(values))
    edges_x, edges_y = np.arange(frequency.size + 1) - 0.5, np.arange(orders.size + 1) - 0.5
    mesh = axes.pcolormesh(
        edges_x,
        edges_y,
        np.ma.masked_invalid(np.abs(values)),
        cmap=colours,
        norm=BoundaryNorm(steps, len(steps), extend="max"),
        edgecolors=PALE,
        linewidth=0.3,
    )
    bar = axes.figure.colorbar(mesh, ax=axes, extend="max", extendfrac=0.09, pad=0.025, fraction=0.06)
    bar.set_ticks(list(steps), labels=[f"{step:g}" for step in steps])
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.tick_params(length=0.0)
    bar.outline.set_linewidth(0.6)
    axes.set_title(label, loc="left", fontsize=9.0, fontweight="normal")
    axes.set_ylabel("harmonic order")
    axes.yaxis.set_major_locator(FixedLocator(list(range(orders.size))))
    axes.set_yticklabels([str(order) for order in orders])
    ticks = _ticks(frequency)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.set_xticklabels([f"{frequency[tick]:.3g}" for tick in ticks])
    axes.tick_params(length=2.5)


def _cross_out(axes: Axes, absent: NDArray[np.bool_]) -> None:
    """A small cross where nothing was measured."""
    rows, columns = np.nonzero(absent)
    axes.scatter(columns, rows, marker="x", s=9, linewidths=0.6, color=GREY, zorder=3)


def _ticks(frequency: NDArray[np.float64]) -> list[int]:
    """Every third dwell and the last, all if there are few."""
    last = frequency.size - 1
    if last < 3 * _TICK_GAP:
        return list(range(last + 1))
    ticks = [tick for tick in range(0, last, _TICK_GAP) if last - tick >= _TICK_GAP - 1]
    return [*ticks, last]


_LOOKS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "before": {"marker": "o", "color": GREY, "markerfacecolor": "white", "markersize": 7.5},
        "recalibrated": {"marker": "s", "color": ORANGE, "markerfacecolor": "white", "markersize": 6.5},
        "after": {"marker": "^", "color": BLUE, "markersize": 8.0},
        "noise alone": {"marker": "|", "color": INK, "markersize": 14.0, "markeredgewidth": 1.8},
    }
)
_LEAST = 1e-3
_ROW = 0.42


def shrink_rows(diagnosis: Diagnosis) -> dict[str, dict[str, float]]:
    """The gaps [%] by row and model; rows are all channels together, each one, and a further recording."""
    both = {"both channels": diagnosis.shrink} if len(diagnosis.by_channel) > 1 else {}
    named = {_short(name, diagnosis): each for name, each in diagnosis.by_channel.items()}
    rows = {
        title: {
            "before": 100.0 * each.before,
            "recalibrated": 100.0 * each.recalibrated,
            "after": 100.0 * each.after,
            "noise alone": 100.0 * each.floor,
        }
        for title, each in ((both | named) or {"both channels": diagnosis.shrink}).items()
    }
    if diagnosis.further is not None:
        rows["other recording" if diagnosis.measured is None else "sweep"] = {
            "before": 100.0 * diagnosis.further.before,
            "recalibrated": 100.0 * diagnosis.further.recalibrated,
            "after": 100.0 * diagnosis.further.after,
            "noise alone": 100.0 * diagnosis.further.floor,
        }
    return rows


def _short(name: str, diagnosis: Diagnosis) -> str:
    known = any(each.name == name for each in diagnosis.given.channels)
    return channel_label(name, diagnosis.given).title.split(" ")[-1] if known else name


def shrink_figure(diagnosis: Diagnosis) -> Figure:
    """The gap on held-out tests, a row for each channel."""
    rows = shrink_rows(diagnosis)
    with styled():
        height = 1.0 + _ROW * len(rows)
        figure = new_figure(4.8, height)
        figure.set_layout_engine("none")
        bottom, top = 0.48 / height, 1.0 - 0.36 / height
        axes = figure.add_axes((0.255, bottom, 0.72, top - bottom))
        for place, gaps in enumerate(rows.values()):
            _draw_row(axes, place, gaps, labelled=place == 0)
        axes.set_yticks(range(len(rows)), [printable(title) for title in rows])
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0.0)
        axes.grid(visible=False, axis="y")
        _scale(axes)
        figure.legend(
            *axes.get_legend_handles_labels(),
            loc="upper center",
            ncols=4,
            handletextpad=0.1,
            columnspacing=1.2,
        )
        return figure


def _draw_row(axes: Axes, place: int, gaps: Mapping[str, float], labelled: bool) -> None:
    known = {name: max(gap, _LEAST) for name, gap in gaps.items() if isfinite(gap)}
    ends = [known[name] for name in ("before", "recalibrated", "after") if name in known]
    if ends:
        axes.plot([min(ends), max(ends)], [place, place], color=PALE, linewidth=4.0, zorder=1)
    for name, look in _LOOKS.items():
        if name in known or labelled:
            at = [known[name]] if name in known else []
            label = name if labelled else None
            axes.plot(at, [place] * len(at), linestyle="none", label=label, zorder=3, **look)


def _scale(axes: Axes) -> None:
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xlim(low / 1.25, high * 1.25)
    axes.xaxis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel("gap, relative rms over held-out tests [%]")


_LETTERS = 24
"""In a line of a name."""

_LINE, _SPACE, _EDGES = 0.155, 0.13, 0.56
"""Height of a line of a name, between two bars, and of the axis [inch]."""

_ROOM = 1.32
"""The axis is so many times as long as the longest bar, for the p-value beside it."""


def regime_figure(diagnosis: Diagnosis) -> Figure:
    """The gap [% of the response] in each regime; the diagnosis must have some."""
    names = [_broken(printable(each.name)) for each in diagnosis.regimes]
    lines = sum(name.count("\n") + 1 for name in names)
    with styled():
        height = _EDGES + _LINE * lines + _SPACE * len(names)
        figure = new_figure(4.6, height)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.385, 0.46 / height, 0.59, 1.0 - _EDGES / height))
        at, above = [], 0.0
        for name in names:
            size = _LINE * (name.count("\n") + 1) + _SPACE
            at.append(above + 0.5 * size)
            above += size
        _draw_bars(axes, diagnosis, at)
        axes.set_yticks(at, names)
        axes.set_ylim(above, 0.0)
        axes.tick_params(axis="y", length=0.0)
        axes.grid(visible=False, axis="y")
        axes.set_axisbelow(True)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.set_xlabel("gap there [% of the response]")
        return figure


def _broken(name: str) -> str:
    """A name in lines, each of which is one of those that are joined by "or"."""
    parts = name.replace(" or ", " or\n").split("\n")
    return "\n".join(line for part in parts for line in wrap(part, _LETTERS))


def _draw_bars(axes: Axes, diagnosis: Diagnosis, at: list[float]) -> None:
    longest = max((each.gap_percent for each in diagnosis.regimes), default=0.0) or 1.0
    for place, each in zip(at, diagnosis.regimes, strict=True):
        significant = each.p_value < LEVEL
        look = {"color": ORANGE} if significant else {"color": PALE, "edgecolor": GREY, "linewidth": 0.5}
        axes.barh(place, each.gap_percent, height=1.3 * _LINE, **look)
        if significant:
            beside = each.gap_percent + 0.02 * longest
            axes.text(beside, place, f"p = {p_value_words(each.p_value)}", va="center", fontsize=8.5)
    axes.set_xlim(0.0, _ROOM * longest)


def regime_picture(diagnosis: Diagnosis) -> Picture | None:
    """The picture for the page with its words; None where no regime was looked at."""
    if not diagnosis.regimes:
        return None
    found = regimes_sentence(diagnosis) or "The recalibrated gap is concentrated in no regime."
    return embed(regime_figure(diagnosis), f"Gap by regime. {found}")


def regime_note(diagnosis: Diagnosis) -> str:
    """What the regimes are, for the page."""
    port = motion_words(diagnosis)
    where = f" of the {port}" if port else ""
    return (
        f"Gap of the recalibrated model beyond the noise. Speed, stroke and direction are those{where}; low and high"
        " are thirds of the instants of each test, slow and fast thirds of the tests; the gap of a drift is what a"
        " linear trend over time changes. Coloured, with its p-value: the misfit is more concentrated there than the"
        " errors of a good model would be"
        f" (below {100.0 * LEVEL:.0f} %, corrected for all regimes by Holm's method)."
    )
