"""``savgs-ident inspect``: what is in a campaign."""

from pathlib import Path

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    CampaignArgument,
    ChannelsOption,
    JsonOption,
    OutOption,
    PlantOption,
    QuietOption,
    model_to_fit,
    read_campaign,
)


@ends_with_code
def inspect(
    campaign: CampaignArgument,
    plant: PlantOption = QUARTER_CAR,
    channels: ChannelsOption = None,
    out: OutOption = Path("out/inspect"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Show what is in a campaign: tests, channels, amplitudes, signal-to-noise, noise, warnings.

    Writes inspect.json, inspect.png and inspect.pdf; of tests that do not repeat motions.png and motions.pdf.

    Example: savgs-ident inspect campaign.csv.gz
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    of = None if plant == QUARTER_CAR else model_to_fit(plant, None, None, ())
    with reporter.working() as progress:
        summary = si.inspect(read_campaign(campaign, channels, progress, of), progress=progress)
        files = summary.save(out, progress)
    return reporter.conclude(summary, files)
