"""Many campaigns as the JSON object of ``campaign.json`` and as a table for CSV and Parquet; SI, the unit beside."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np

from savgs_ident.fit.trend import CONFIDENCE, Line, Scatter, Trend
from savgs_ident.report.campaigns_study import CampaignRow, RowStatus, Study
from savgs_ident.report.campaigns_words import headline, widening_words


def campaigns_record(study: Study, settings: Mapping[str, object], command: Sequence[str]) -> dict[str, Any]:
    """Rows, trends and what they were made with.

    ``trends`` has for every free parameter the weighted mean, the line over ``x`` and what both leave: the 95 %
    intervals are of errors that were widened by ``widening``. An ``own_stderr`` leaves out what all campaigns have
    in common; scatter and slope are judged by it.
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


def campaigns_columns(study: Study) -> dict[str, list[object]]:
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


def _trend(trend: Trend, study: Study, name: str) -> dict[str, object]:
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
