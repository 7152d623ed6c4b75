"""The presenter of what is in a campaign, and of many campaigns; what draws is loaded when something is drawn."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from savgs_ident.report.presenters import AbstractPresenter, Figures

if TYPE_CHECKING:
    from savgs_ident.campaigns.study import CampaignStudy
    from savgs_ident.responses.summary import CampaignSummary


class _CampaignSummary(AbstractPresenter["CampaignSummary"]):
    stem = "inspect"

    def record(self, result: "CampaignSummary") -> Mapping[str, Any]:
        from savgs_ident.report.campaigns.inspect import summary_record

        return summary_record(result)

    def text(self, result: "CampaignSummary") -> RenderableType:
        from savgs_ident.report.campaigns.inspect import campaign_text

        return campaign_text(dict(self.record(result)), result.campaign.layout)

    def doubts(self, result: "CampaignSummary") -> tuple[str, ...]:
        del result
        return ()

    def figures(self, result: "CampaignSummary") -> Figures:
        from savgs_ident.report.campaigns.inspect import campaign_figure

        return {"inspect": lambda: campaign_figure(result)}


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
        from savgs_ident.report.campaigns.figures import campaigns_figure

        return {"campaign": lambda: campaigns_figure(result)} if result.units else {}

    def more(self, result: "CampaignStudy", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.campaigns.page import write_campaigns
        from savgs_ident.report.campaigns.record import campaigns_columns

        yield from write_campaigns(folder, campaigns_columns(result))


CAMPAIGN_SUMMARY = _CampaignSummary()
CAMPAIGN_STUDY = _CampaignStudy()
