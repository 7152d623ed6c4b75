"""``savgs-ident inspect``: what is in a campaign."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import OK, ends_with_code
from savgs_ident.cli.options import CampaignArgument, ChannelsOption, JsonOption, QuietOption


@ends_with_code
def inspect(
    campaign: CampaignArgument,
    channels: ChannelsOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/inspect"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Show what is in a campaign: tests, channels, amplitudes, signal-to-noise, noise, warnings.

    Writes inspect.json, inspect.png and inspect.pdf.

    Example: savgs-ident inspect campaign.csv.gz
    """
    from savgs_ident.recordings.read import read_campaign
    from savgs_ident.report.campaign_summary import summarise_campaign, summary_record
    from savgs_ident.report.campaign_text import campaign_text
    from savgs_ident.report.files import prepare_folder, write_json
    from savgs_ident.report.terminal import plain

    voice = Voice(json, quiet)
    prepare_folder(out)
    with voice.working() as progress:
        progress(f"reading {campaign}")
        told = progress.fraction(f"reading {campaign}")
        recorded = read_campaign(campaign, channels, progress=told)
        progress("estimating responses")
        summary = summarise_campaign(recorded)
        record = summary_record(summary)
        files = [write_json(out / "inspect.json", record)]
        progress("drawing")
        from savgs_ident.report.campaign_figure import campaign_figure
        from savgs_ident.report.picture import write_figure

        files += write_figure(out, "inspect", campaign_figure(summary))
    voice.show(campaign_text(record), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    return OK
