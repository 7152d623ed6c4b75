"""``savgs-ident false-alarms``: how often a diagnosis finds something where nothing is missing."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.models import BaselineOption
from savgs_ident.cli.options import CampaignArgument, ChannelsOption, JsonOption, QuietOption


@ends_with_code
def false_alarms(
    campaign: CampaignArgument,
    draws: Annotated[int, typer.Option("--draws", min=1, help="Synthetic campaigns.")] = 100,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="FILE", help="Rig file, or model.toml of an earlier fit."),
    ] = None,
    model: BaselineOption = None,
    max_frequency: Annotated[
        float | None, typer.Option("--max-frequency", metavar="HZ", help="Leave out faster dwells.")
    ] = None,
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to compare.")] = 9,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of all random numbers.")] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep the draws that an earlier run left in --out DIR.")
    ] = False,
    channels: ChannelsOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/false-alarms"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Count false alarms: how often would `diagnose` find something in campaigns like CAMPAIGN with nothing missing?

    The baseline is recalibrated on CAMPAIGN; campaigns are drawn from it (its frequencies, its noise, parameters
    within what it leaves open) and diagnosed. The odds that CAMPAIGN itself gives are put beside theirs. Takes some
    seconds a draw.

    Writes false_alarms.json, false_alarms.png, false_alarms.pdf and draws.jsonl, from which --resume goes on.

    Exit code 1 if more than one draw in fifty is a false alarm.

    Example: savgs-ident false-alarms campaign.csv.gz --draws 100
    """
    from savgs_ident.cli.alarming import Job, count_false_alarms
    from savgs_ident.cli.diagnosing import Job as DiagnosisJob

    command = ("savgs-ident", *sys.argv[1:])
    diagnosis = DiagnosisJob(campaign, channels, rig, model, (), max_frequency, orders, command)
    return count_false_alarms(Job(diagnosis, draws, seed, resume), Voice(json, quiet), out)
