"""``savgs-ident posterior``: how well the identified parameters are known."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.options import CampaignArgument, ChannelsOption, JsonOption, ModelArgument, QuietOption


class SamplerName(StrEnum):
    """The samplers there are."""

    emcee = "emcee"
    nuts = "nuts"


@ends_with_code
def posterior(
    model: ModelArgument,
    campaign: CampaignArgument,
    sampler: Annotated[
        SamplerName,
        typer.Option("--sampler", help="emcee: an ensemble of walkers; nuts: gradient-based trajectories."),
    ] = SamplerName.emcee,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the chain that an earlier run left in --out DIR.")
    ] = False,
    fixed_tolerances: Annotated[
        bool, typer.Option("--fixed-tolerances", help="Hold what is known to a tolerance at its value.")
    ] = False,
    target_ess: Annotated[
        float,
        typer.Option("--target-ess", min=1.0, help="Effective sample size to reach for every parameter."),
    ] = 1000.0,
    time_limit: Annotated[
        float, typer.Option("--time-limit", metavar="SECONDS", min=1.0, help="Stop sampling after this.")
    ] = 600.0,
    patience: Annotated[
        float,
        typer.Option(
            "--patience",
            metavar="SECONDS",
            min=0.0,
            help="Go on beyond the target up to this, for medians to a fortieth of their sd.",
        ),
    ] = 85.0,
    max_frequency: Annotated[
        float | None, typer.Option("--max-frequency", metavar="HZ", help="Leave out faster dwells.")
    ] = None,
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to compare.")] = 9,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of all random numbers.")] = 1,
    channels: ChannelsOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/posterior"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Sample the posterior of the parameters that MODEL identified: intervals, trade-offs, predictions.

    Tolerances are marginalised over, the noise's scale and the model's discrepancy estimated along.

    Writes posterior.html (the report), posterior.json, posterior.nc (ArviZ inference data) and chain-emcee.h5 or
    chain-nuts.h5, from which a run that was stopped is continued with --resume.

    Exit code 1 if the chains did not converge.

    Example: savgs-ident posterior out/fit/model.toml campaign.csv.gz --sampler nuts
    """
    from savgs_ident.cli.sampling import Job, sample
    from savgs_ident.posterior.settings import SamplingSettings

    settings = SamplingSettings(
        sampler=sampler.value,
        target_ess=target_ess,
        time_limit_s=time_limit,
        patience_s=patience,
        fixed_tolerances=fixed_tolerances,
        orders=orders,
        seed=seed,
    )
    command = ("savgs-ident", *sys.argv[1:])
    return sample(
        Job(model, campaign, channels, max_frequency, settings, resume, command), Voice(json, quiet), out
    )
