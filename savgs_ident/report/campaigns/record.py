"""Many campaigns as the JSON object of ``campaign.json``, as a table on disk, and in words in the terminal.

SI throughout, the unit beside the value. The sentences and cells that terminal and page share are made here.
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from math import isfinite
from typing import Any

import numpy as np
from rich.console import Group, RenderableType

from savgs_ident.campaigns.study import CampaignRow, CampaignStudy, Identified, RowStatus
from savgs_ident.campaigns.trends import CONFIDENCE, Line, Scatter, Trend
from savgs_ident.report.text import DASH, decimal, fixed, interval, numeral, plain, table, with_error


def value_words(estimate: Identified) -> str:
    """Value and error in the parameter's unit, for a column that is headed by it: ``5790 ± 12``."""
    if not isfinite(estimate.stderr):
        return f"{numeral(estimate.value, estimate.stderr)}, not identified"
    return with_error(estimate.value, estimate.stderr)


def parameter_headers(study: CampaignStudy) -> tuple[str, ...]:
    """The names of the parameters with their units, to head a column each."""
    return tuple(name if unit == "1" else f"{name} [{unit}]" for name, unit in study.units.items())


def with_unit(text: str, unit: str) -> str:
    """A number with its unit, if it has one."""
    return text if unit == "1" else f"{text} {unit}"


def headline(study: CampaignStudy) -> str:
    """What came out, in one sentence."""
    there = len(study.rows)
    done = f"{study.count(RowStatus.ok)} of {there} campaign{'s' * (there != 1)} identified"
    moving = [name for name, trend in study.trends.items() if trend.line and trend.line.rises_or_falls]
    apart = [name for name, trend in study.trends.items() if trend.mean.scatter.beyond_errors]
    if not any(trend.line for trend in study.trends.values()):
        return f"{done}."
    if moving:
        return f"{done}; {_listed(moving)} change{'s' * (len(moving) == 1)} {over(study)}."
    if apart:
        return f"{done}; {_listed(apart)} scatter{'s' * (len(apart) == 1)} more than the errors say, without a trend."
    return f"{done}; no parameter changes."


def over(study: CampaignStudy) -> str:
    """What trends are over."""
    return "with time" if study.by_time else "from campaign to campaign"


def alarm(study: CampaignStudy) -> str:
    """Why not everything is to be trusted; empty if it is."""
    failed, doubtful = study.count(RowStatus.failed), study.count(RowStatus.not_trusted)
    parts = []
    if failed:
        parts.append(f"{failed} of {len(study.rows)} campaigns failed")
    if doubtful:
        parts.append(f"{doubtful} of {len(study.rows)} campaigns {_are(doubtful)} not to be trusted")
    return f"{' and '.join(parts)}; the trends are without {_them(failed + doubtful)}." if parts else ""


def slope_words(study: CampaignStudy, name: str, line: Line) -> str:
    """The change of a parameter with its interval: ``+0.0010 (0.0002 to 0.0018) per day``."""
    low, high = line.slope_interval
    sign = "+" if line.slope > 0.0 else ""
    change = f"{sign}{numeral(line.slope, line.slope_stderr)} ({interval(low, high, line.slope_stderr)})"
    return f"{with_unit(change, study.units[name])} per {study.per}"


def trend_words(trend: Trend) -> str:
    """Whether there is a trend, in a word."""
    if trend.line is None:
        return DASH
    if not trend.line.rises_or_falls:
        return "none"
    return "rises" if trend.line.slope > 0.0 else "falls"


def scatter_words(trend: Trend) -> str:
    """Chi2 of the mean over its degrees of freedom, and whether it is more than chance."""
    scatter = trend.mean.scatter
    if scatter.dof == 0:
        return DASH
    ratio = decimal(scatter.chi2 / scatter.dof, 2)
    return f"{ratio}, more than the errors" if scatter.beyond_errors else ratio


def widening_words(study: CampaignStudy) -> tuple[str, ...]:
    """What was done where campaigns scatter more than their errors, a sentence a parameter."""
    sentences = []
    for name, trend in study.trends.items():
        widened = []
        if trend.mean.scatter.widening > 1.0:
            widened.append(f"of the mean {decimal(trend.mean.scatter.widening, 1)} times")
        if trend.line is not None and trend.line.scatter.widening > 1.0:
            widened.append(f"of the trend {decimal(trend.line.scatter.widening, 1)} times")
        if widened:
            sentences.append(
                f"{name} scatters more than the errors say: the error {' and '.join(widened)} widened to the scatter."
            )
    return tuple(sentences)


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _them(count: int) -> str:
    return "it" if count == 1 else "them"


def campaigns_record(
    study: CampaignStudy, settings: Mapping[str, object], command: Sequence[str]
) -> dict[str, Any]:
    """Rows, trends and what they were made with.

    ``trends`` has for every free parameter the weighted mean, the line over ``x`` and what both leave: the 95 %
    intervals are of errors that were widened by ``widening``. An ``own_stderr`` leaves out what all campaigns have
    in common; scatter and slope are tested with it.
    """
    return {
        "schema": 1,
        "sentence": headline(study),
        "trusted": study.count(RowStatus.ok) == len(study.rows),
        "campaigns": [_row(row) for row in study.rows],
        "counts": {status.value: study.count(status) for status in RowStatus},
        "order": "start time" if study.by_time else "name",
        "x": {"unit": study.per, "from": utc_text(study.first), "values": study.place},
        "trends": {name: _trend(trend, study, name) for name, trend in study.trends.items()},
        "confidence": CONFIDENCE,
        "notes": [*study.notes, *widening_words(study)],
        "settings": settings,
        "command": " ".join(command),
    }


def utc_text(start: float | None) -> str | None:
    """A time [s since 1970] as ISO 8601 in UTC, to the millisecond."""
    if start is None:
        return None
    return datetime.fromtimestamp(start, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def utc_minute(start: float | None) -> str | None:
    """A time [s since 1970] to the minute, in UTC: for tables that are read, and narrow."""
    if start is None:
        return None
    return datetime.fromtimestamp(start, UTC).strftime("%Y-%m-%d %H:%M")


def campaigns_columns(study: CampaignStudy) -> dict[str, list[object]]:
    """A column a quantity, headed by its name and unit, a row a campaign; None where there is no number."""
    rows = study.rows
    columns: dict[str, list[object]] = {
        "name": [row.name for row in rows],
        "source": [row.source for row in rows],
        "start [UTC]": [utc_text(row.start) for row in rows],
        "status": [row.status.value for row in rows],
        "reason": [row.reason for row in rows],
        "chi2/dof [1]": [row.chi2_per_dof for row in rows],
    }
    for name, unit in study.units.items():
        values = study.values(name)
        headers = (f"{name} [{unit}]", f"{name} stderr [{unit}]", f"{name} own stderr [{unit}]")
        for header, numbers in zip(headers, values, strict=True):
            columns[header] = [float(number) if np.isfinite(number) else None for number in numbers]
    return columns


def _row(row: CampaignRow) -> dict[str, object]:
    return {
        "name": row.name,
        "source": row.source,
        "status": row.status.value,
        "reason": row.reason,
        "start": utc_text(row.start),
        "chi2_per_dof": row.chi2_per_dof,
        "parameters": {
            name: {
                "value": each.value,
                "stderr": each.stderr,
                "own_stderr": each.own_stderr,
                "unit": each.unit,
            }
            for name, each in row.parameters.items()
        },
    }


def _trend(trend: Trend, study: CampaignStudy, name: str) -> dict[str, object]:
    unit = study.units[name]
    low, high = trend.mean.interval
    return {
        "unit": unit,
        "campaigns": int(study.counted(name).sum()),
        "mean": {
            "value": trend.mean.value,
            "stderr": trend.mean.stderr,
            "own_stderr": trend.mean.own_stderr,
            "lo": low,
            "hi": high,
        }
        | _scatter(trend.mean.scatter),
        "scatters": trend.mean.scatter.beyond_errors,
        "slope": None if trend.line is None else _slope(trend.line, unit, study.per),
    }


def _slope(line: Line, unit: str, per: str) -> dict[str, object]:
    low, high = line.slope_interval
    return {
        "value": line.slope,
        "stderr": line.slope_stderr,
        "lo": low,
        "hi": high,
        "unit": f"{unit}/{per}",
        "changes": line.rises_or_falls,
        "centre": line.centre,
        "value_at_centre": line.value,
        "stderr_at_centre": line.value_stderr,
    } | _scatter(line.scatter)


def _scatter(scatter: Scatter) -> dict[str, object]:
    return {
        "chi2": scatter.chi2,
        "dof": scatter.dof,
        "probability": scatter.probability,
        "widening": scatter.widening,
    }


def campaigns_text(study: CampaignStudy) -> RenderableType:
    """The tables, and sentences where campaigns scatter."""
    parts: list[RenderableType] = [plain(headline(study), "bold"), plain(""), _campaigns(study)]
    if study.trends:
        parts.append(_trends(study))
    parts += [plain(f"- {note}") for note in (*study.notes, *widening_words(study))]
    return Group(*parts, plain(""))


def trend_rows(study: CampaignStudy) -> list[tuple[str, str, str, str, str]]:
    """For every parameter: name, mean, chi2 per degree of freedom about it, trend in a word, and in numbers."""
    return [
        (
            name,
            with_unit(with_error(trend.mean.value, trend.mean.stderr), study.units[name]),
            scatter_words(trend),
            trend_words(trend),
            DASH if trend.line is None else slope_words(study, name, trend.line),
        )
        for name, trend in study.trends.items()
    ]


TREND_HEADERS = ("Parameter", "Weighted mean", "chi2/dof about it", "Trend", "Change (95 % interval)")
"""What :func:`trend_rows` gives."""


def _campaigns(study: CampaignStudy) -> RenderableType:
    names = tuple(study.units)
    timed = any(row.start is not None for row in study.rows)
    headers = (
        "campaign",
        *(("start [UTC]",) if timed else ()),
        "status",
        "chi2/dof",
        *parameter_headers(study),
    )
    rows = []
    for row in study.rows:
        known = row.parameters
        values = (value_words(known[name]) if name in known else DASH for name in names)
        status = row.status.value.upper() if row.status is not RowStatus.ok else row.status.value
        start = (utc_minute(row.start) or DASH,) if timed else ()
        rows.append((row.name, *start, status, fixed(row.chi2_per_dof, 3), *values))
    return table("Campaigns", headers, rows, texts=tuple(range(2 + timed)))


def _trends(study: CampaignStudy) -> RenderableType:
    return table("Together", [each.lower() for each in TREND_HEADERS], trend_rows(study), texts=(0, 2, 3, 4))
