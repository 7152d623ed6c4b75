"""``savgs-ident posterior``: how well the identified parameters are known."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code, print_error
from savgs_ident.cli.options import (
    QUARTER_CAR,
    CampaignArgument,
    ChannelsOption,
    FixedTolerancesOption,
    JsonOption,
    MaxFrequencyOption,
    ModelArgument,
    OrdersOption,
    OutOption,
    PlantOption,
    QuietOption,
    SamplerName,
    SeedOption,
    command_line,
    identified_model,
    read_recorded,
)


@ends_with_code
def posterior(
    model: ModelArgument,
    campaign: CampaignArgument,
    plant: PlantOption = QUARTER_CAR,
    sampler: Annotated[
        SamplerName,
        typer.Option("--sampler", help="emcee: an ensemble of walkers; nuts: gradient-based trajectories."),
    ] = SamplerName.emcee,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the chain that an earlier run left in --out DIR.")
    ] = False,
    fixed_tolerances: FixedTolerancesOption = False,
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
    ] = 30.0,
    max_frequency: MaxFrequencyOption = None,
    orders: OrdersOption = 9,
    seed: SeedOption = 1,
    channels: ChannelsOption = None,
    out: OutOption = Path("out/posterior"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Sample the posterior of the parameters that MODEL identified: intervals, trade-offs, predictions.

    Tolerances are marginalised over, the noise's scale and the model's discrepancy estimated along. A road is cut
    into windows, and without dwells so is a sweep.

    Writes posterior.html (the report), posterior.json, posterior.nc (ArviZ inference data) and chain-emcee.h5 or
    chain-nuts.h5, from which a run that was stopped is continued with --resume.

    Exit code 1 if the chains did not converge, or the model does not explain the data.

    Example: savgs-ident posterior out/fit/model.toml campaign.csv.gz --sampler nuts
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    identified = identified_model(plant, model)
    chain = out / f"chain-{sampler.value}.h5"
    try:
        with reporter.drawing() as progress:
            found = si.sample(
                identified,
                read_recorded(campaign, channels, progress, identified),
                sampler.value,
                target_ess=target_ess,
                time_limit=time_limit,
                patience=patience,
                fixed_tolerances=fixed_tolerances,
                max_frequency=max_frequency,
                orders=orders,
                seed=seed,
                chain=chain,
                resume=resume,
                command=command_line(),
                progress=progress,
            )
            files = found.save(out, progress)
    except KeyboardInterrupt:
        if chain.exists():
            print_error(f"The chain so far is in {chain}: the same command with --resume goes on from there.")
        raise
    return reporter.conclude(found, files)
