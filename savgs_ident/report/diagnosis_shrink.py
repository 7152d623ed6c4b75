"""How far the gap shrinks: before, recalibrated, after and the noise alone, on a common scale, row by row."""

from collections.abc import Mapping
from math import isfinite
from types import MappingProxyType
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from savgs_ident.diagnose.result import Diagnosis
from savgs_ident.report.readings import READINGS
from savgs_ident.report.style import BLUE, GREY, INK, ORANGE, PALE, label_of, new_figure, styled

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
    """The gaps [%] by row and model; rows are both channels together, each channel, and the sweep."""
    both = {"both channels": diagnosis.shrink} if len(diagnosis.by_channel) > 1 else {}
    named = {_title(name): each for name, each in diagnosis.by_channel.items()}
    rows = {
        title: {
            "before": 100.0 * each.before,
            "recalibrated": 100.0 * each.recalibrated,
            "after": 100.0 * each.after,
            "noise alone": 100.0 * each.floor,
        }
        for title, each in ((both | named) or {"both channels": diagnosis.shrink}).items()
    }
    if diagnosis.sweep is not None:
        rows["sweep"] = {
            "before": 100.0 * diagnosis.sweep.before,
            "recalibrated": 100.0 * diagnosis.sweep.recalibrated,
            "after": 100.0 * diagnosis.sweep.after,
            "noise alone": 100.0 * diagnosis.sweep.floor,
        }
    return rows


def shrink_figure(diagnosis: Diagnosis) -> Figure:
    """The gap on tests left out, a row for each channel."""
    rows = shrink_rows(diagnosis)
    with styled():
        height = 1.0 + _ROW * len(rows)
        figure = new_figure(4.8, height)
        figure.set_layout_engine("none")
        bottom, top = 0.48 / height, 1.0 - 0.36 / height
        axes = figure.add_axes((0.255, bottom, 0.72, top - bottom))
        for place, gaps in enumerate(rows.values()):
            _draw_row(axes, place, gaps, labelled=place == 0)
        axes.set_yticks(range(len(rows)), [label_of(title) for title in rows])
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


def _title(name: str) -> str:
    return READINGS[name].title.split(" ")[-1] if name in READINGS else name


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
    axes.set_xlabel("gap, relative rms over the tests left out [%]")
