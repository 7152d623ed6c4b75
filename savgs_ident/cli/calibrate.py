"""``savgs-ident calibrate``: whether the posterior's intervals hold what they say."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    CampaignArgument,
    ChannelsOption,
    JobsOption,
    JsonOption,
    ModelArgument,
    OutOption,
    QuietOption,
    SamplerName,
    SchedulerOption,
    SeedOption,
    command_line,
    read_campaign,
)


@ends_with_code
def calibrate(
    model: ModelArgument,
    campaign: CampaignArgument,
    trials: Annotated[int, typer.Option("--trials", min=1, help="Synthetic campaigns.")] = 100,
    sampler: Annotated[SamplerName, typer.Option("--sampler", help="Sampler to try.")] = SamplerName.emcee,
    every: Annotated[
        int, typer.Option("--every", min=1, help="Take every so many dwells only: quicker, coarser.")
    ] = 1,
    seed: SeedOption = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the trials that an earlier run left in --out DIR.")
    ] = False,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    channels: ChannelsOption = None,
    out: OutOption = Path("out/calibrate"),
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
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    identified = si.load_model(model)
    with reporter.working() as progress:
        study = si.calibrate(
            identified,
            read_campaign(campaign, channels, progress),
            trials,
            sampler.value,
            every=every,
            seed=seed,
            folder=out,
            resume=resume,
            channels=channels,
            jobs=jobs,
            scheduler=scheduler,
            command=command_line(),
            progress=progress,
        )
        files = study.save(out, progress)
    return reporter.conclude(study, (*files, out / "trials.jsonl"))
