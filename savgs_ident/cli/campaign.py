"""``savgs-ident campaign``: identify many campaigns, and follow the parameters through them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from savgs_ident.cli.console import BAD_INPUT, NOT_TRUSTED, OK, Reporter, ends_with_code, print_error
from savgs_ident.cli.options import (
    QUARTER_CAR,
    ChannelsOption,
    FitOrdersOption,
    FixedTolerancesOption,
    FreeOption,
    JsonOption,
    MaxFrequencyOption,
    ModelName,
    ModelOption,
    OutOption,
    PlantOption,
    QuietOption,
    RigOption,
    SchedulerOption,
    WithOption,
    check_model,
    command_line,
)

if TYPE_CHECKING:
    from savgs_ident import CampaignStudy


@ends_with_code
def campaign(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER ...",
            help="Campaigns as `fit` takes them, and folders of several: one in each file or subfolder.",
            show_default=False,
        ),
    ],
    scheduler: SchedulerOption = None,
    plant: PlantOption = QUARTER_CAR,
    rig: RigOption = None,
    model: ModelOption = None,
    beside: WithOption = None,
    free: FreeOption = None,
    channels: ChannelsOption = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            min=1,
            help="Campaigns at a time on this machine, each on one core; as many as there are cores if not given.",
            show_default=False,
        ),
    ] = None,
    orders: FitOrdersOption = 9,
    fixed_tolerances: FixedTolerancesOption = False,
    max_frequency: MaxFrequencyOption = None,
    out: OutOption = Path("out/campaign"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Identify many campaigns side by side, and say whether the parameters agree and whether they change.

    In a folder, files that are named after tests (dwell_2.35Hz.csv, standstill.csv) are one campaign; other files
    are a campaign each, and so is each subfolder. A campaign that fails is reported, the others go on. Where one
    was identified before from the same data, rig and settings, its result is used: a run that was stopped goes on
    where it was when it is started again.

    On a Dask cluster (install the extra `cluster`) the workers must have the same version of this package and see the
    recordings under the same paths.

    Writes fit.json and model.toml in a folder a campaign, campaigns.csv and campaigns.parquet (a row a campaign),
    campaign.json (with the trends), campaign.png, campaign.pdf and campaign.html.

    Exit code 1 if a campaign failed or is not to be trusted, 2 if none could be read.

    Example: savgs-ident campaign recordings/ --free mu_r c_sd --workers 2
    """
    import savgs_ident as si

    check_model(plant, model)
    reporter = Reporter(json, quiet)
    with reporter.working() as progress:
        study = si.run_campaigns(
            folders,
            out,
            plant=plant,
            rig=rig,
            model=(model or ModelName.simtr).value,
            beside=beside or (),
            free=free or (),
            channels=channels,
            orders=orders,
            fixed_tolerances=fixed_tolerances,
            max_frequency=max_frequency,
            workers=workers,
            scheduler=scheduler,
            command=command_line(),
            progress=progress,
        )
        files = study.save(out, progress)
    return conclude(study, files, reporter)


def conclude(study: "CampaignStudy", files: tuple[Path, ...], reporter: Reporter) -> int:
    """Show the study, and say of each campaign what is wrong with it; the exit code."""
    reporter.show_result(study, files)
    for line in study.failures:
        print_error(line)
    if study.unreadable:
        print_error("Error: no campaign could be read. Remedy: mend what is said of each above.")
        return BAD_INPUT
    if not study.doubts:
        return OK
    print_error(" ".join(study.doubts))
    return NOT_TRUSTED
