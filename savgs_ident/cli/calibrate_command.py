"""``savgs-ident calibrate``: whether the posterior's intervals hold what they say."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.options import CampaignArgument, ChannelsOption, JsonOption, ModelArgument, QuietOption
from savgs_ident.cli.posterior_command import SamplerName


@ends_with_code
def calibrate(
    model: ModelArgument,
    campaign: CampaignArgument,
    trials: Annotated[int, typer.Option("--trials", min=1, help="Synthetic campaigns.")] = 100,
    sampler: Annotated[SamplerName, typer.Option("--sampler", help="Sampler to try.")] = SamplerName.emcee,
    every: Annotated[
        int, typer.Option("--every", min=1, help="Take every so many dwells only: quicker, coarser.")
    ] = 1,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of all random numbers.")] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep the trials that an earlier run left in --out DIR.")
    ] = False,
    channels: ChannelsOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/calibrate"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Check the posterior on synthetic campaigns: do 95 % intervals hold the truth 95 times in a hundred?

    Parameters are drawn from their priors about MODEL, campaigns like CAMPAIGN are simulated with them and
    sampled (simulation-based calibration). Takes some seconds a trial.

    Writes calibration.json, calibration.png, calibration.pdf and trials.jsonl, from which --resume goes on.

    Exit code 1 if coverage or ranks are not what they should be.

    Example: savgs-ident calibrate out/fit/model.toml campaign.csv.gz --trials 100 --every 3
    """
    from savgs_ident.cli.calibrating import Job, calibrate_by_trials

    command = ("savgs-ident", *sys.argv[1:])
    job = Job(model, campaign, channels, trials, sampler.value, every, seed, resume, command)
    return calibrate_by_trials(job, Voice(json, quiet), out)
