"""``savgs-ident diagnose``: where the gap between rig and model lies, what causes it, how far it shrinks."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    BaselineOption,
    CampaignArgument,
    ChannelsOption,
    JsonOption,
    MaxFrequencyOption,
    OrdersOption,
    OutOption,
    QuietOption,
    command_line,
    read_baseline,
    read_campaign,
)


@ends_with_code
def diagnose(
    campaign: CampaignArgument,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="FILE", help="Rig file, or model.toml of an earlier fit."),
    ] = None,
    model: BaselineOption = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", metavar="EFFECT ...", help="Leave effects out of the catalogue."),
    ] = None,
    max_frequency: MaxFrequencyOption = None,
    orders: OrdersOption = 9,
    channels: ChannelsOption = None,
    out: OutOption = Path("out/diagnose"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Diagnose the sim-to-real gap: where it lies, which unmodelled effect causes it, how far it shrinks.

    The baseline model is recalibrated first, within its tolerances, so that a part inside its tolerance is not
    called a gap. Every effect of the catalogue is then tested, alone and in pairs; if none explains the recordings
    the verdict is "unknown", with the port at which something is missing.

    Writes diagnosis.html (the report) and diagnosis.json.

    Exit code 1 if a search that the verdict stands on did not converge.

    Example: savgs-ident diagnose campaign.csv.gz --model simqc
    """
    import savgs_ident as si
    from savgs_ident.core.output import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    baseline = read_baseline(rig, model)
    with reporter.working() as progress:
        found = si.diagnose(
            baseline,
            read_campaign(campaign, channels, progress),
            without=without or (),
            orders=orders,
            max_frequency=max_frequency,
            progress=progress,
        ).made_by(command_line())
        files = found.save(out, progress)
    return reporter.conclude(found, files)
