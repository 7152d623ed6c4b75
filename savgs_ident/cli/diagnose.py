"""``savgs-ident diagnose``: where the gap between rig and model lies, what causes it, how far it shrinks."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    BaselineOption,
    ChannelsOption,
    HeldOutOption,
    JsonOption,
    MaxFrequencyOption,
    OrdersOption,
    OutOption,
    PlantOption,
    QuietOption,
    WithOption,
    baseline_model,
    command_line,
    read_recorded,
)


@ends_with_code
def diagnose(
    campaign: Annotated[
        Path,
        typer.Argument(
            metavar="CAMPAIGN",
            help="CSV (plain or .gz) or MCAP file, or a folder of them; a MATLAB file of an axis.",
            show_default=False,
        ),
    ],
    plant: PlantOption = QUARTER_CAR,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="FILE", help="Rig file, or model.toml of an earlier fit."),
    ] = None,
    model: BaselineOption = None,
    beside: WithOption = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", metavar="EFFECT ...", help="Leave effects out of the catalogue."),
    ] = None,
    held_out: HeldOutOption = None,
    max_frequency: MaxFrequencyOption = None,
    orders: OrdersOption = 9,
    channels: ChannelsOption = None,
    out: OutOption = Path("out/diagnose"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Diagnose the sim-to-real gap: where it lies, which unmodelled effect causes it, how far it shrinks.

    The baseline model is recalibrated first, within its tolerances, so that a part inside its tolerance is not
    called a gap. Every effect of the catalogue is then tested, alone and in pairs; if none explains the recordings
    the verdict is "unknown", with the port at which something is missing.

    A road is cut into windows, and without dwells so is a sweep.

    Writes diagnosis.html (the report) and diagnosis.json.

    Exit code 1 if a search that the verdict stands on did not converge.

    Example: savgs-ident diagnose campaign.csv.gz --model simqc
    Example: savgs-ident diagnose tests.csv --plant pendulum.py:Pendulum
    Example: savgs-ident diagnose axis.mat --plant axis --held-out axis_again.mat
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    baseline = baseline_model(plant, rig, model, beside or ())
    with reporter.drawing() as progress:
        found = si.diagnose(
            baseline,
            read_recorded(campaign, channels, progress, baseline),
            held_out=None if held_out is None else read_recorded(held_out, channels, progress, baseline),
            without=without or (),
            orders=orders,
            max_frequency=max_frequency,
            command=command_line(),
            progress=progress,
        )
        files = found.save(out, progress)
    return reporter.conclude(found, files)
