"""``savgs-ident closed-loop``: a controller on the nonlinear rig."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    BaselineOption,
    JsonOption,
    ModelArgument,
    OutOption,
    QuietOption,
    command_line,
    effects_of,
)


class LoopTestName(StrEnum):
    """The tests there are; named here so that ``--help`` needs not load JAX."""

    harmonic = "harmonic"
    sweep = "sweep"
    iso = "iso"
    bump = "bump"


class RoadClass(StrEnum):
    """Classes of random roads after ISO 8608."""

    A = "A"
    B = "B"
    C = "C"
    D = "D"


@ends_with_code
def closed_loop(
    model_file: ModelArgument,
    test: Annotated[
        LoopTestName,
        typer.Option(
            "--test",
            help="harmonic: the cam at one frequency; sweep: 0 to 3 Hz in 60 s; iso: a random road; bump.",
        ),
    ] = LoopTestName.harmonic,
    controller: Annotated[
        Path | None,
        typer.Option(
            "--controller", metavar="FILE", help="A controller.json of `design`; designed anew by default."
        ),
    ] = None,
    frequency: Annotated[
        float, typer.Option("--frequency", metavar="HZ", min=0.1, max=10.0, help="Of the harmonic test.")
    ] = 2.0,
    road: Annotated[
        RoadClass, typer.Option("--road", help="Class of the random road after ISO 8608.")
    ] = RoadClass.C,
    speed: Annotated[
        float | None,
        typer.Option(
            "--speed", metavar="KM/H", min=1.0, max=300.0, help="Of driving: iso 72 by default, bump 20."
        ),
    ] = None,
    posterior: Annotated[
        Path | None,
        typer.Option(
            "--posterior",
            metavar="FILE",
            help="A posterior.nc: run on its samples, not on the fit's covariance.",
        ),
    ] = None,
    rigs: Annotated[
        int, typer.Option("--rigs", metavar="N", min=0, help="Further rigs that the data allow to run on.")
    ] = 20,
    causes: Annotated[
        bool,
        typer.Option("--causes", help="Also without friction, limits, noise, one at a time: why it is so."),
    ] = False,
    model: BaselineOption = None,
    out: OutOption = Path("out/closed-loop"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Run a controller on the nonlinear rig with its drive and instruments: passive, active, and with failures.

    Writes closed-loop.json, closed-loop.csv (signals), closed-loop.html and pictures: signals over time, failures,
    other rigs, causes.

    Exit code 1 if the loop or the passive rig is not stable, here or on another rig that the data allow, or the law
    ceased to believe the link angle, or the rig file's own fit is not to be trusted.

    Example: savgs-ident closed-loop out/fit/model.toml --test sweep --rigs 5
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    shown = si.load_model(model_file, effects_of(model))
    with reporter.working() as progress:
        study = si.close_loop(
            shown,
            controller,
            test.value,
            frequency=frequency,
            road=road.value,
            speed=None if speed is None else speed / 3.6,
            posterior=posterior,
            rigs=rigs,
            causes=causes,
            command=command_line(),
            progress=progress,
        )
        files = study.save(out, progress)
    return reporter.conclude(study, files)
