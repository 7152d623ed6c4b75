"""``savgs-ident false-alarms``: how often a diagnosis finds something where nothing is missing."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    BaselineOption,
    CampaignArgument,
    ChannelsOption,
    JobsOption,
    JsonOption,
    MaxFrequencyOption,
    OrdersOption,
    OutOption,
    PlantOption,
    QuietOption,
    SchedulerOption,
    SeedOption,
    baseline_model,
    command_line,
    read_recorded,
)


@ends_with_code
def false_alarms(
    campaign: CampaignArgument,
    plant: PlantOption = QUARTER_CAR,
    draws: Annotated[int, typer.Option("--draws", min=1, help="Synthetic campaigns.")] = 100,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="FILE", help="Rig file, or model.toml of an earlier fit."),
    ] = None,
    model: BaselineOption = None,
    max_frequency: MaxFrequencyOption = None,
    orders: OrdersOption = 9,
    seed: SeedOption = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the draws that an earlier run left in --out DIR.")
    ] = False,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    channels: ChannelsOption = None,
    out: OutOption = Path("out/false-alarms"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Count false alarms: how often would `diagnose` find something in campaigns like CAMPAIGN with nothing missing?

    The baseline is recalibrated on CAMPAIGN; campaigns are drawn from it (its frequencies, its noise, parameters
    within what it leaves open) and diagnosed. The odds that CAMPAIGN itself gives are put beside theirs. Takes as
    long as a diagnosis for each draw, and once before.

    Writes false_alarms.json, false_alarms.png, false_alarms.pdf and draws.jsonl, from which --resume goes on.

    Exit code 1 if more than one draw in fifty is a false alarm.

    Example: savgs-ident false-alarms campaign.csv.gz --draws 100
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    baseline = baseline_model(plant, rig, model, ())
    with reporter.working() as progress:
        study = si.false_alarms(
            baseline,
            read_recorded(campaign, channels, progress, baseline),
            draws,
            orders=orders,
            max_frequency=max_frequency,
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
    return reporter.conclude(study, (*files, out / "draws.jsonl"))
