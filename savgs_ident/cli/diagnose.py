"""``savgs-ident diagnose``: where the gap between rig and model lies, what causes it, how far it shrinks."""

from collections.abc import Sequence
from functools import reduce
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from savgs_ident.cli.console import Progress, Reporter, ends_with_code
from savgs_ident.cli.options import (
    BaselineOption,
    ChannelsOption,
    JsonOption,
    MaxFrequencyOption,
    ModelName,
    OrdersOption,
    OutOption,
    PlantName,
    QuietOption,
    WithOption,
    command_line,
    effects_of,
    read_campaign,
)

if TYPE_CHECKING:
    from savgs_ident import Campaign, DrivenMotion, PlantModel, QuarterCar


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
    plant: Annotated[
        PlantName,
        typer.Option(
            "--plant",
            help="quarter_car: the rig, in dwells. axis: a servo axis, by the force of its drive along the "
            "recorded motion.",
        ),
    ] = PlantName.quarter_car,
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
    held_out: Annotated[
        Path | None,
        typer.Option(
            "--held-out", metavar="FILE", help="Another motion of the axis, which is predicted and compared."
        ),
    ] = None,
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

    Writes diagnosis.html (the report) and diagnosis.json.

    Exit code 1 if a search that the verdict stands on did not converge.

    Example: savgs-ident diagnose campaign.csv.gz --model simqc
    Example: savgs-ident diagnose axis.mat --plant axis --held-out axis_again.mat
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    with reporter.working() as progress:
        found = si.diagnose(
            _baseline(plant, rig, model, beside or ()),
            _recorded(plant, campaign, channels, progress),
            held_out=None if held_out is None else si.load_motion(held_out),
            without=without or (),
            orders=orders,
            max_frequency=max_frequency,
            command=command_line(),
            progress=progress,
        )
        files = found.save(out, progress)
    return reporter.conclude(found, files)


def _baseline(
    plant: PlantName, rig: Path | None, model: ModelName | None, beside: Sequence[str]
) -> "QuarterCar | PlantModel":
    """The baseline with the effects ``beside`` it; raises :class:`InputError` for options that do not go together."""
    import savgs_ident as si

    if plant is PlantName.quarter_car:
        return reduce(add, beside, si.load_baseline(rig, effects_of(model)))
    if rig is not None or model is not None:
        raise si.InputError(f"--rig and --model are no options of the {plant.value}", remedy="leave them out")
    return reduce(add, beside, si.PlantModel(si.Axis(), si.Axis.parameters))


def _recorded(
    plant: PlantName, path: Path, channels: Path | None, progress: Progress
) -> "Campaign | DrivenMotion":
    """What was recorded; raises :class:`InputError` if it cannot be read."""
    import savgs_ident as si

    if plant is PlantName.quarter_car:
        return read_campaign(path, channels, progress)
    progress(f"reading {path}")
    return si.load_motion(path)
