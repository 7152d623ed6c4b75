"""``savgs-ident fit``: identify a plant, the rig or another one."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    CampaignArgument,
    ChannelsOption,
    FitOrdersOption,
    FixedTolerancesOption,
    FreeOption,
    HeldOutOption,
    JsonOption,
    MaxFrequencyOption,
    ModelOption,
    OutOption,
    PlantOption,
    QuietOption,
    RigOption,
    WithOption,
    command_line,
    model_to_fit,
    read_recorded,
)


@ends_with_code
def fit(
    campaign: CampaignArgument,
    plant: PlantOption = QUARTER_CAR,
    rig: RigOption = None,
    model: ModelOption = None,
    beside: WithOption = None,
    free: FreeOption = None,
    channels: ChannelsOption = None,
    orders: FitOrdersOption = 9,
    fixed_tolerances: FixedTolerancesOption = False,
    peak_to_peak: Annotated[
        bool, typer.Option("--peak-to-peak", help="Fit peak-to-peak values only, as the paper did.")
    ] = False,
    max_frequency: MaxFrequencyOption = None,
    held_out: HeldOutOption = None,
    out: OutOption = Path("out/fit"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Identify a plant from a campaign: parameters with errors, how well they fit, what the data identify.

    A road of at least six seconds is cut into windows; without dwells so is a sweep or any other motion.

    A plant with one coordinate whose first input is the force of its drive is held against that along the measured
    motion, where there are no dwells.

    Writes fit.json, model.toml (the identified model), bode.png and bode.pdf; of windows spectra.png and spectra.pdf,
    along a motion drive.png and drive.pdf.

    Effects that a diagnosis names are put into the model by --with, and their parameters are identified, too.

    Exit code 1 if the fit did not converge, the model does not explain the data, or they do not identify every
    parameter.

    Example: savgs-ident fit campaign.csv.gz --free mu_r c_sd --max-frequency 4

    Example: savgs-ident fit campaign.csv.gz --with rail_stribeck

    Example: savgs-ident fit tests.csv --plant pendulum.py:Pendulum

    Example: savgs-ident fit axis.mat --plant axis --with guide_preload --held-out axis_again.mat
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    start = model_to_fit(plant, rig, model, beside or ())
    with reporter.drawing() as progress:
        found = si.fit(
            start,
            read_recorded(campaign, channels, progress, start),
            free or (),
            held_out=None if held_out is None else read_recorded(held_out, channels, progress, start),
            orders=orders,
            peak_to_peak=peak_to_peak,
            fixed_tolerances=fixed_tolerances,
            max_frequency=max_frequency,
            command=command_line(),
            progress=progress,
        )
        files = found.save(out, progress)
    return reporter.conclude(found, files)
