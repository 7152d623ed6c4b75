"""``savgs-ident simulate``: what a model does on a cam, at frequencies or along a sweep."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK, ends_with_code
from savgs_ident.cli.models import ModelName
from savgs_ident.cli.options import JsonOption, ModelArgument, QuietOption


@ends_with_code
def simulate(
    model_file: ModelArgument,
    frequency: Annotated[
        list[float] | None,
        typer.Option(
            "--frequency", metavar="HZ ...", help="Frequencies of the cam; 28 from 0.5 to 6 by default."
        ),
    ] = None,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="A sweep from 0 to 3 Hz in 60 s instead, from standstill.")
    ] = False,
    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", metavar="CAMPAIGN", help="Road and link as in the dwells of a campaign."),
    ] = None,
    model: Annotated[
        ModelName | None,
        typer.Option("--model", help="simtr or simqc; by default what the file was identified with."),
    ] = None,
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order.")] = 15,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/simulate"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Simulate a model on the cam: its periodic responses at given frequencies, or one sweep.

    Writes simulate.json, simulate.csv, simulate.png and simulate.pdf.

    Exit code 1 if a motion was not found.

    Example: savgs-ident simulate out/fit/model.toml --frequency 1 2 2.35
    """
    from savgs_ident.cli.models import rig_and_effects
    from savgs_ident.cli.simulating import simulate_responses, simulate_sweep
    from savgs_ident.report.files import prepare_folder
    from savgs_ident.simulate.compilation import use_persistent_cache

    if sum((bool(frequency), sweep, campaign is not None)) > 1:
        raise typer.BadParameter("choose one of --frequency, --sweep and --campaign")
    for value in frequency or ():
        if not 0.0 < value < float("inf"):
            raise typer.BadParameter(f"--frequency {value:g}: give a frequency above 0 Hz")
    voice = Voice(json, quiet)
    prepare_folder(out)
    rig, effects = rig_and_effects(model_file, model)
    use_persistent_cache()
    if sweep:
        trusted = simulate_sweep(rig, effects, voice, out)
    else:
        trusted = simulate_responses(rig, effects, tuple(frequency or ()), campaign, orders, voice, out)
    if trusted:
        return OK
    complain("Not to be trusted: the simulation did not converge everywhere; see the status in the table.")
    return NOT_TRUSTED
