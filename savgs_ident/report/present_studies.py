"""The presenters of many campaigns, and of blind trials.

What draws is loaded when something is drawn.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from savgs_ident.report.presenters import AbstractPresenter, Figures

if TYPE_CHECKING:
    from savgs_ident.campaigns.study import CampaignStudy
    from savgs_ident.validation.blind import BlindStudy


class _CampaignStudy(AbstractPresenter["CampaignStudy"]):
    stem = "campaign"

    def record(self, result: "CampaignStudy") -> Mapping[str, Any]:
        from savgs_ident.report.campaigns.record import campaigns_record

        return campaigns_record(result, result.settings, result.origin.command)

    def text(self, result: "CampaignStudy") -> RenderableType:
        from savgs_ident.report.campaigns.record import campaigns_text

        return campaigns_text(result)

    def doubts(self, result: "CampaignStudy") -> tuple[str, ...]:
        from savgs_ident.report.campaigns.record import alarm

        found = alarm(result)
        return (found,) if found else ()

    def page(self, result: "CampaignStudy") -> str:
        from savgs_ident.report.campaigns.page import campaigns_html

        return campaigns_html(result, result.settings, result.origin.command)

    def figures(self, result: "CampaignStudy") -> Figures:
        from savgs_ident.report.campaigns.page import campaigns_figure

        return {"campaign": lambda: campaigns_figure(result)} if result.units else {}

    def more(self, result: "CampaignStudy", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.campaigns.page import write_campaigns
        from savgs_ident.report.campaigns.record import campaigns_columns

        yield from write_campaigns(folder, campaigns_columns(result))


CAMPAIGN_STUDY = _CampaignStudy()


class _BlindStudy(AbstractPresenter["BlindStudy"]):
    stem = "blind"

    def record(self, result: "BlindStudy") -> Mapping[str, Any]:
        from savgs_ident.report.blind import blind_record

        return blind_record(result.scores, result.settings, result.origin.command, result.moved)

    def text(self, result: "BlindStudy") -> RenderableType:
        from savgs_ident.report.blind import blind_text

        return blind_text(result.scores)

    def doubts(self, result: "BlindStudy") -> tuple[str, ...]:
        return () if result.trusted else ("the diagnosis is not right as often as it should be.",)

    def page(self, result: "BlindStudy") -> str:
        from savgs_ident.report.blind import blind_html

        return blind_html(result.scores, result.settings, result.origin.command, result.moved)

    def figures(self, result: "BlindStudy") -> Figures:
        from savgs_ident.report.blind_figures import confusion_figure, reliability_figure

        scores = result.scores
        return {
            "confusion": lambda: confusion_figure(scores),
            "reliability": lambda: reliability_figure(scores),
        }


BLIND_STUDY = _BlindStudy()
