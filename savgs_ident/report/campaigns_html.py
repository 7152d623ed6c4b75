"""The report on many campaigns: one page."""

from collections.abc import Mapping, Sequence

from savgs_ident.report.campaigns_figure import campaigns_figure
from savgs_ident.report.campaigns_record import utc_minute
from savgs_ident.report.campaigns_study import RowStatus, Study
from savgs_ident.report.campaigns_text import TREND_HEADERS, trend_rows
from savgs_ident.report.campaigns_words import (
    alarm,
    headline,
    over,
    parameter_headers,
    value_words,
    widening_words,
)
from savgs_ident.report.html import embed
from savgs_ident.report.numerals import DASH, count, decimal
from savgs_ident.report.origin import versions_of
from savgs_ident.report.section_page import Fact, Section, SectionPage, Table, section_page

_PACKAGES = ("jax", "optimistix", "numpy", "scipy")

_TOLERANCES = (
    "What is known to a tolerance is the same in all campaigns of a rig, and moves what is identified in each alike:"
    " it is in the errors of the tables, but not in the bars, the bands, the scatter and the changes."
)


def campaigns_html(study: Study, settings: Mapping[str, object], command: Sequence[str]) -> str:
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
            versions=versions_of(_PACKAGES),
        )
    )


def _facts(study: Study) -> tuple[Fact, ...]:
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


def _trends(study: Study) -> tuple[Section, ...]:
    if not study.units:
        return ()
    told = "; ".join(f"{row[0]} {row[3]}" for row in trend_rows(study)) or "no campaign counts"
    widened = " ".join(widening_words(study))
    return (
        Section(
            "trends",
            "Parameters through the campaigns",
            note=f"{_TOLERANCES} {widened}".rstrip(),
            picture=embed(
                campaigns_figure(study), f"Identified parameters with errors, a panel each: {told}."
            ),
            caption=(
                "Bars and bands are intervals of 95 %. A line is drawn through where the interval of its slope leaves"
                " out zero, and dashed where it does not."
            ),
            wide=True,
            table=Table("What they say together", TREND_HEADERS, tuple(trend_rows(study)), (1,)),
        ),
    )


def _campaigns(study: Study) -> Section:
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
    return Section("campaigns", "Campaigns", table=Table("One by one", headers, rows, numeric))


def _wrong(study: Study) -> tuple[Section, ...]:
    rows = tuple((row.name, row.status.value, row.reason) for row in study.rows if row.reason)
    if not rows:
        return ()
    table = Table("Failed or not to be trusted", ("Campaign", "Status", "Why"), rows, ())
    return (Section("wrong", "What went wrong", table=table),)


def _recordings(study: Study) -> Section:
    rows = tuple((row.name, row.source) for row in study.rows)
    return Section("recordings", "Recordings", table=Table("Where they are", ("Campaign", "Path"), rows, ()))


def _settings(settings: Mapping[str, object]) -> dict[str, str]:
    free = settings.get("free")
    highest = settings.get("max_frequency_hz")
    return {
        "Model": str(settings.get("model")),
        "Free parameters": ", ".join(map(str, free)) if isinstance(free, list | tuple) else str(free),
        "Dwells": "all" if highest is None else f"up to {highest} Hz",
    }
