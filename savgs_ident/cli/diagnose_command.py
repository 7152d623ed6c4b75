"""``savgs-ident diagnose``: where the gap between rig and model lies, what causes it, how far it shrinks."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.models import BaselineOption
from savgs_ident.cli.options import CampaignArgument, ChannelsOption, JsonOption, QuietOption


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
    max_frequency: Annotated[
        float | None, typer.Option("--max-frequency", metavar="HZ", help="Leave out faster dwells.")
    ] = None,
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to compare.")] = 9,
    channels: ChannelsOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/diagnose"
    ),
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
    from savgs_ident.cli.diagnosing import Job, run_diagnosis

    command = ("savgs-ident", *sys.argv[1:])
    job = Job(campaign, channels, rig, model, tuple(without or ()), max_frequency, orders, command)
    return run_diagnosis(job, Voice(json, quiet), out)
