"""The report on many campaigns: one page, its figure, and their table as CSV and as Parquet with types and times.

The figure shows the free parameters: each with its error over time, the trend and its band.
"""

import io
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.stats import norm

from savgs_ident.campaigns.study import CampaignStudy, RowStatus
from savgs_ident.campaigns.trends import CONFIDENCE, Line
from savgs_ident.core.files import write_bytes, write_table
from savgs_ident.core.presentation import package_versions
from savgs_ident.report.campaigns.record import (
    TREND_HEADERS,
    alarm,
    headline,
    over,
    parameter_headers,
    trend_rows,
    utc_minute,
    value_words,
    widening_words,
)
from savgs_ident.report.html import Fact, Section, SectionPage, Table, embed, section_page
from savgs_ident.report.text import DASH, count, decimal
from savgs_ident.report.theme import BLUE, GREY, INK, new_figure, printable, styled

_PACKAGES = ("jax", "optimistix", "numpy", "scipy")

_TOLERANCES = (
    "What is known to a tolerance is the same in all campaigns of a rig, and moves what is identified in each alike:"
    " it is in the errors of the tables, but not in the bars, the bands, the scatter and the changes."
)


def campaigns_html(study: CampaignStudy, settings: Mapping[str, object], command: Sequence[str]) -> str:
    """The page: one file, no network, nothing executed; the same study gives the same bytes."""
    return section_page(
        SectionPage(
            kind="Many campaigns",
            title=f"{len(study.rows)} campaigns",
            sentence=headline(study),
            intro=" ".join(study.notes),
            alarm=alarm(study),
            facts=_facts(study),
            sections=(*_trends(study), _campaigns(study), *_wrong(study), _recordings(study)),
            settings=_settings(settings),
            command=" ".join(command),
            versions=package_versions(_PACKAGES),
        )
    )


def _facts(study: CampaignStudy) -> tuple[Fact, ...]:
    there = len(study.rows)
    failed, doubtful = study.count(RowStatus.failed), study.count(RowStatus.not_trusted)
    moving = [name for name, trend in study.trends.items() if trend.line and trend.line.rises_or_falls]
    apart = [name for name, trend in study.trends.items() if trend.mean.scatter.beyond_errors]
    return (
        Fact("Identified", count(study.count(RowStatus.ok)), f"of {there} campaigns"),
        Fact("Not to be trusted", count(doubtful), "left out of the trends", bad=doubtful > 0),
        Fact("Failed", count(failed), "left out of the trends", bad=failed > 0),
        Fact("Changing", count(len(moving)), ", ".join(moving) or f"no parameter {over(study)}"),
        Fact("Scattering", count(len(apart)), ", ".join(apart) or "none more than the errors say"),
    )


def _trends(study: CampaignStudy) -> tuple[Section, ...]:
    if not study.units:
        return ()
    trends = "; ".join(f"{row[0]} {row[3]}" for row in trend_rows(study)) or "no campaign counts"
    widened = " ".join(widening_words(study))
    return (
        Section(
            "trends",
            "Parameters through the campaigns",
            note=f"{_TOLERANCES} {widened}".rstrip(),
            picture=embed(
                campaigns_figure(study), f"Identified parameters with errors, a panel each: {trends}."
            ),
            caption=(
                "Bars and bands are intervals of 95 %. A line is drawn through where the interval of its slope leaves"
                " out zero, and dashed where it does not."
            ),
            wide=True,
            table=Table("Means and trends", TREND_HEADERS, tuple(trend_rows(study)), (1,)),
        ),
    )


def _campaigns(study: CampaignStudy) -> Section:
    names = tuple(study.units)
    timed = any(row.start is not None for row in study.rows)
    rows = tuple(
        (
            row.name,
            *((utc_minute(row.start) or DASH,) if timed else ()),
            row.status.value,
            DASH if row.chi2_per_dof is None else decimal(row.chi2_per_dof, 3),
            *(value_words(row.parameters[name]) if name in row.parameters else DASH for name in names),
        )
        for row in study.rows
    )
    headers = (
        "Campaign",
        *(("Start [UTC]",) if timed else ()),
        "Status",
        "chi2/dof",
        *parameter_headers(study),
    )
    numeric = tuple(range(2 + timed, len(headers)))
    return Section("campaigns", "Campaigns", table=Table("All campaigns", headers, rows, numeric))


def _wrong(study: CampaignStudy) -> tuple[Section, ...]:
    rows = tuple((row.name, row.status.value, row.reason) for row in study.rows if row.reason)
    if not rows:
        return ()
    table = Table("Failed or not to be trusted", ("Campaign", "Status", "Why"), rows, ())
    return (Section("wrong", "Failed campaigns", table=table),)


def _recordings(study: CampaignStudy) -> Section:
    rows = tuple((row.name, row.source) for row in study.rows)
    return Section("recordings", "Recordings", table=Table("Paths", ("Campaign", "Path"), rows, ()))


def _settings(settings: Mapping[str, object]) -> dict[str, str]:
    free = settings.get("free")
    highest = settings.get("max_frequency_hz")
    return {
        "Model": str(settings.get("model")),
        "Free parameters": ", ".join(map(str, free)) if isinstance(free, list | tuple) else str(free),
        "Dwells": "all" if highest is None else f"up to {highest} Hz",
    }


_TIMES = "start [UTC]"
_TEXTS = ("name", "source", "status", "reason")


def write_campaigns(folder: Path, columns: Mapping[str, Sequence[object]]) -> tuple[Path, Path]:
    """Write ``campaigns.csv`` and ``campaigns.parquet``, where None is an empty cell.

    Raises :class:`InputError` if they cannot be written.
    """
    return (
        write_table(folder / "campaigns.csv", columns),
        write_bytes(folder / "campaigns.parquet", _parquet(columns)),
    )


def _parquet(columns: Mapping[str, Sequence[object]]) -> bytes:
    content = io.BytesIO()
    pq.write_table(pa.table({name: _array(name, cells) for name, cells in columns.items()}), content)
    return content.getvalue()


def _array(name: str, cells: Sequence[object]) -> pa.Array:
    if name == _TIMES:
        times = [
            None if each is None else datetime.fromisoformat(str(each)).astimezone(UTC) for each in cells
        ]
        return pa.array(times, pa.timestamp("ms", tz="UTC"))
    return pa.array(cells, pa.string() if name in _TEXTS else pa.float64())


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
