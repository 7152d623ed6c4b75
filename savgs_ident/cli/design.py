"""``savgs-ident design``: an H-infinity controller for a rig."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    EffectsOption,
    JsonOption,
    ModelArgument,
    OutOption,
    QuietOption,
    command_line,
    effects_of,
)


@ends_with_code
def design(
    model_file: ModelArgument,
    weights: Annotated[
        Path | None,
        typer.Option(
            "--weights", metavar="FILE", help="TOML file of weights that differ from the usual ones."
        ),
    ] = None,
    posterior: Annotated[
        Path | None,
        typer.Option(
            "--posterior",
            metavar="FILE",
            help="posterior.nc: try the controller on its samples, not on what the rig file knows.",
        ),
    ] = None,
    rigs: Annotated[
        int, typer.Option("--rigs", metavar="N", min=1, help="On how many rigs the controller is tried.")
    ] = 50,
    order: Annotated[
        int | None,
        typer.Option("--order", metavar="N", min=1, help="States of the controller; as many as it gets."),
    ] = None,
    rate: Annotated[
        float, typer.Option("--rate", metavar="HZ", help="Rate of the computer that runs it.")
    ] = 1000.0,
    model: EffectsOption = None,
    out: OutOption = Path("out/design"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Design an H-infinity controller for a model: gamma with its check, margins, and how it does on other rigs.

    The rigs come from the posterior, or else from the covariance that an identified rig carries, or else, for a
    drawing, from its tolerances. A file of weights names those that change, each with its unit:
    accel_bound = { value = 2.0, unit = "m/s^2" }

    Writes design.json, controller.json (the sampled controller), design.html (the report), and as .png and .pdf
    gamma, loop, ride, robustness and regularisation.

    Exit code 1 if gamma is not confirmed, or the loop is not stable with the controller as it is used, when sampled
    or on one of the rigs, or the rig file's own fit is not to be trusted.

    Example: savgs-ident design out/fit/model.toml --posterior out/posterior/posterior.nc
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    shown = si.load_model(model_file, effects_of(model))
    with reporter.working() as progress:
        found = si.design(
            shown,
            weights=weights,
            posterior=posterior,
            rigs=rigs,
            order=order,
            rate=rate,
            command=command_line(),
            progress=progress,
        )
        files = found.save(out, progress)
    return reporter.conclude(found, files)
