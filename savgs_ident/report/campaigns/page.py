"""The report on many campaigns: one page, and their table as CSV and as Parquet with types and times."""

import io
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from savgs_ident.campaigns.study import CampaignStudy, RowStatus
from savgs_ident.core.files import write_bytes
from savgs_ident.core.output import write_table
from savgs_ident.core.presentation import package_versions
from savgs_ident.report.campaigns.figures import campaigns_figure
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
