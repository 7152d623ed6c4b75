"""Many campaigns in the terminal: a row each, the trends, and what to know about them."""

from rich.console import Group, RenderableType

from savgs_ident.report.campaigns_record import utc_minute
from savgs_ident.report.campaigns_study import RowStatus, Study
from savgs_ident.report.campaigns_words import (
    headline,
    parameter_headers,
    scatter_words,
    slope_words,
    trend_words,
    value_words,
    widening_words,
    with_unit,
)
from savgs_ident.report.numerals import DASH, with_error
from savgs_ident.report.terminal import fixed, plain, table


def campaigns_text(study: Study) -> RenderableType:
    """The tables, and sentences where campaigns scatter."""
    parts: list[RenderableType] = [plain(headline(study), "bold"), plain(""), _campaigns(study)]
    if study.trends:
        parts.append(_trends(study))
    parts += [plain(f"- {note}") for note in (*study.notes, *widening_words(study))]
    return Group(*parts, plain(""))


def trend_rows(study: Study) -> list[tuple[str, str, str, str, str]]:
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


def _campaigns(study: Study) -> RenderableType:
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
        told = (value_words(known[name]) if name in known else DASH for name in names)
        status = row.status.value.upper() if row.status is not RowStatus.ok else row.status.value
        start = (utc_minute(row.start) or DASH,) if timed else ()
        rows.append((row.name, *start, status, fixed(row.chi2_per_dof, 3), *told))
    return table("Campaigns", headers, rows, texts=tuple(range(2 + timed)))


def _trends(study: Study) -> RenderableType:
    return table("Together", [each.lower() for each in TREND_HEADERS], trend_rows(study), texts=(0, 2, 3, 4))
