"""The files that say what many campaigns say together."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from savgs_ident.cli.console import Progress
from savgs_ident.report.campaigns_figure import campaigns_figure
from savgs_ident.report.campaigns_html import campaigns_html
from savgs_ident.report.campaigns_record import campaigns_columns, campaigns_record
from savgs_ident.report.campaigns_study import Study
from savgs_ident.report.campaigns_table import write_campaigns
from savgs_ident.report.files import write_bytes, write_json
from savgs_ident.report.picture import write_figure

FILE_NAMES = (
    "campaign.json", "campaigns.csv", "campaigns.parquet", "campaign.png", "campaign.pdf", "campaign.html"
)  # fmt: skip
"""Their names, which no campaign may have."""


def write_study(
    study: Study, settings: Mapping[str, Any], command: Sequence[str], out: Path, progress: Progress
) -> tuple[dict[str, Any], list[Path]]:
    """Write record, tables, picture and report to ``out``: the record, and the files."""
    record = campaigns_record(study, settings, command)
    files = [write_json(out / "campaign.json", record), *write_campaigns(out, campaigns_columns(study))]
    progress("drawing")
    if study.units:
        files += write_figure(out, "campaign", campaigns_figure(study))
    page = campaigns_html(study, settings, command)
    files.append(write_bytes(out / "campaign.html", page.encode()))
    return record, files
