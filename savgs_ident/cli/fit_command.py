"""``savgs-ident fit`` and ``savgs-ident demo``: identify the rig."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.models import ModelName, ModelOption
from savgs_ident.cli.options import CampaignArgument, ChannelsOption, JsonOption, QuietOption


@ends_with_code
def fit(
    campaign: CampaignArgument,
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
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to fit.")] = 9,
    fixed_tolerances: Annotated[
        bool, typer.Option("--fixed-tolerances", help="Hold what is known to a tolerance at its value.")
    ] = False,
    peak_to_peak: Annotated[
        bool, typer.Option("--peak-to-peak", help="Fit peak-to-peak values only, as the paper did.")
    ] = False,
    max_frequency: Annotated[
        float | None, typer.Option("--max-frequency", metavar="HZ", help="Leave out faster dwells.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/fit"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Identify the rig from a campaign: parameters with errors, how well they fit, what the data can tell.

    Writes fit.json, model.toml (the identified rig), bode.png and bode.pdf.

    Exit code 1 if the fit did not converge or the data cannot tell every parameter.

    Example: savgs-ident fit campaign.csv.gz --free mu_r c_sd --max-frequency 4
    """
    from savgs_ident.cli.identify import Job, identify
    from savgs_ident.core.rig import default_rig_path
    from savgs_ident.fit.settings import FitSettings

    settings = FitSettings(
        orders=orders,
        fixed_tolerances=fixed_tolerances,
        quantity="peak_to_peak" if peak_to_peak else "harmonics",
    )
    command = ("savgs-ident", *sys.argv[1:])
    job = Job(
        campaign,
        rig or default_rig_path(),
        channels,
        model,
        tuple(free or ()),
        settings,
        max_frequency,
        command,
    )
    return identify(job, Voice(json, quiet), out)


@ends_with_code
def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/demo"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Do the main job on the campaign that comes with the program: identify the rig and draw its response.

    Writes fit.json, model.toml, bode.png and bode.pdf.

    Exit code 1 if the fit did not converge or the data cannot tell every parameter.

    Example: savgs-ident demo
    """
    from savgs_ident.cli.identify import Job, identify
    from savgs_ident.core.rig import default_campaign_path, default_rig_path
    from savgs_ident.fit.settings import FitSettings

    command = ("savgs-ident", *sys.argv[1:])
    job = Job(
        default_campaign_path(), default_rig_path(), None, ModelName.simtr, (), FitSettings(), None, command
    )
    return identify(job, Voice(json, quiet), out)
