"""``savgs-ident campaign``: identify many campaigns, and follow the parameters through them."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.models import ModelName, ModelOption
from savgs_ident.cli.options import ChannelsOption, JsonOption, QuietOption


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
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="Dask cluster to work on instead of this machine."
        ),
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="RIG", help="Rig file to start from; the shipped one by default."),
    ] = None,
    model: ModelOption = ModelName.simtr,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free", metavar="NAME ...", help="Parameters to identify instead of the paper's four."
        ),
    ] = None,
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
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to fit.")] = 9,
    fixed_tolerances: Annotated[
        bool,
        typer.Option(
            "--fixed-tolerances",
            help="Hold what is known to a tolerance at its value.",
        ),
    ] = False,
    max_frequency: Annotated[
        float | None, typer.Option("--max-frequency", metavar="HZ", help="Leave out faster dwells.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/campaign"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Identify many campaigns side by side, and say whether the parameters agree and whether they change.

    In a folder, files that are named after tests (dwell_2.35Hz.csv, standstill.csv) are one campaign; other files
    are a campaign each, and so is each subfolder. A campaign that fails is reported, the others go on. Where one
    was identified before from the same data, rig and settings, its result is kept: a run that was stopped goes on
    where it was when it is started again.

    On a Dask cluster (install the extra `cluster`) the workers must have the same version of this package and see the
    recordings under the same paths.

    Writes fit.json and model.toml in a folder a campaign, campaigns.csv and campaigns.parquet (a row a campaign),
    campaign.json (with the trends), campaign.png, campaign.pdf and campaign.html.

    Exit code 1 if a campaign failed or is not to be trusted, 2 if none could be read.

    Example: savgs-ident campaign recordings/ --free mu_r c_sd --workers 2
    """
    from savgs_ident.cli.campaign_work import identify_one
    from savgs_ident.cli.campaigns import ManyJob, run_campaigns, spread_of
    from savgs_ident.cli.identify import Job
    from savgs_ident.core.rig import default_rig_path
    from savgs_ident.fit.settings import FitSettings

    one = Job(
        Path(),
        rig or default_rig_path(),
        channels,
        model,
        tuple(free or ()),
        FitSettings(orders=orders, fixed_tolerances=fixed_tolerances),
        max_frequency,
        ("savgs-ident", *sys.argv[1:]),
    )
    job = ManyJob(tuple(folders), one, scheduler, workers or cores())
    return run_campaigns(job, identify_one, spread_of(job), Voice(json, quiet), out)


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
