"""The free parameters of many campaigns: each with its error over time, the trend and its band."""

from datetime import UTC, datetime

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.stats import norm

from savgs_ident.campaigns.study import CampaignStudy
from savgs_ident.campaigns.trends import CONFIDENCE, Line
from savgs_ident.report.theme import BLUE, GREY, INK, new_figure, printable, styled

_SIGMAS = float(norm.ppf(0.5 * (1.0 + CONFIDENCE)))
_NAMED = 16
"""Most campaigns that are named below the axis."""

_LONGEST = 18
"""Most characters of a name there."""

_SECONDS = {"hour": 3600.0, "day": 86400.0}


def campaigns_figure(study: CampaignStudy) -> Figure:
    """A panel a free parameter; needs one at least."""
    names = tuple(study.units)
    with styled():
        figure = new_figure(7.4, 0.9 + 1.75 * len(names))
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        at, grid = _axis(study)
        for axes, name in zip(panels, names, strict=True):
            _draw(axes, study, name, at, grid)
        _label_axis(panels[-1], study)
        panels[0].set_title(
            f"{len(study.rows)} campaigns; bars and band {CONFIDENCE:.0%}, without what all have in common",
            loc="left",
        )
        handles = {
            label: h for axes in panels for h, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(handles.values(), handles, loc="outside lower center", ncols=3)
    return figure


def _axis(study: CampaignStudy) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where campaigns are drawn, and a grid of places over all of them, both in the unit of ``place``."""
    known = study.place[np.isfinite(study.place)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    margin = 0.04 * (high - low) or 0.5
    return study.place, np.linspace(low - margin, high + margin, 200)


def _shown(study: CampaignStudy, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places as the axis has them: dates, or numbers."""
    if study.first is None:
        return place
    origin = float(date2num(datetime.fromtimestamp(study.first, UTC)))
    return np.asarray(origin + place * _SECONDS[study.per] / _SECONDS["day"])


def _draw(
    axes: Axes, study: CampaignStudy, name: str, at: NDArray[np.float64], grid: NDArray[np.float64]
) -> None:
    unit = study.units[name]
    axes.set_ylabel(printable(name if unit == "1" else f"{name} [{unit}]"))
    value, _, stderr = study.values(name)
    counted = study.counted(name)
    known = np.isfinite(at) & np.isfinite(value)
    for mask, face, label in (
        (known & counted, BLUE, "identified"),
        (known & ~counted, "white", "not to be trusted: not in the trend"),
    ):
        if mask.any():
            error = np.where(np.isfinite(stderr), _SIGMAS * stderr, 0.0)[mask]
            axes.errorbar(
                _shown(study, at[mask]), value[mask], error, fmt="o" if face == BLUE else "s", color=INK,
                markerfacecolor=face, markersize=4.5, capsize=2.0, elinewidth=0.9, label=label,
            )  # fmt: skip
    trend = study.trends.get(name)
    if trend is not None and trend.line is not None:
        _draw_line(axes, study, trend.line, grid)
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.ticklabel_format(axis="y", useOffset=False)


def _draw_line(axes: Axes, study: CampaignStudy, line: Line, grid: NDArray[np.float64]) -> None:
    middle, half = line.at(grid)
    x = _shown(study, grid)
    style = "-" if line.rises_or_falls else (0, (5, 2))
    axes.plot(x, middle, color=BLUE, linestyle=style, label=_line_label(line))
    axes.fill_between(x, middle - half, middle + half, color=BLUE, alpha=0.15, linewidth=0.0)


def _line_label(line: Line) -> str:
    return "trend" if line.rises_or_falls else "no trend: within its interval"


def _label_axis(axes: Axes, study: CampaignStudy) -> None:
    if study.by_time:
        locator = AutoDateLocator(maxticks=8)
        axes.xaxis.set_major_locator(locator)
        axes.xaxis.set_major_formatter(ConciseDateFormatter(locator, tz=UTC))
        axes.set_xlabel("start of the campaign [UTC]")
    elif len(study.rows) <= _NAMED:
        names = [printable(row.name) for row in study.rows]
        short = [name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…" for name in names]
        axes.set_xticks(study.place, short, rotation=90 if len(short) > 4 else 0)
        axes.grid(visible=False, axis="x")
    else:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("campaign, in the order of names")
    axes.tick_params(axis="x", color=GREY)
