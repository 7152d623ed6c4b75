"""``savgs-ident simulate``: what a model does under its input, at frequencies or along a sweep."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    EffectsOption,
    JsonOption,
    ModelArgument,
    OutOption,
    PlantOption,
    QuietOption,
    identified_model,
    read_campaign,
)


@ends_with_code
def simulate(
    model_file: ModelArgument,
    plant: PlantOption = QUARTER_CAR,
    frequency: Annotated[
        list[float] | None,
        typer.Option(
            "--frequency", metavar="HZ ...", help="Frequencies of the input; 28 from 0.5 to 6 by default."
        ),
    ] = None,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="A sweep from 0 to 3 Hz in 60 s instead, from standstill.")
    ] = False,
    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", metavar="CAMPAIGN", help="Inputs as in the dwells of a campaign."),
    ] = None,
    model: EffectsOption = None,
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order.")] = 15,
    out: OutOption = Path("out/simulate"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Simulate a model, the rig's on its cam: its periodic responses at given frequencies, or one sweep.

    Writes simulate.json, simulate.csv, simulate.png and simulate.pdf.

    Exit code 1 if a motion was not found, or the rig file's own fit is not to be trusted.

    Example: savgs-ident simulate out/fit/model.toml --frequency 1 2 2.35
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    # A sweep is a call of its own, which cannot see the others.
    if sweep and (frequency or campaign is not None):
        raise typer.BadParameter("choose one of --frequency, --sweep and --campaign")
    reporter = Reporter(json, quiet)
    prepare_folder(out)
    shown = identified_model(plant, model_file, model)
    with reporter.working() as progress:
        found: si.SimulatedResponse | si.SimulatedSweep
        if sweep:
            found = si.simulate_sweep(shown, progress)
        else:
            recorded = None if campaign is None else read_campaign(campaign, None, progress, shown)
            found = si.simulate(shown, frequency or (), recorded, orders, progress)
        files = found.save(out, progress)
    return reporter.conclude(found, files)
