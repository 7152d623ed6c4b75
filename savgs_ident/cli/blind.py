"""``savgs-ident blind``: how often the diagnosis is right about effects that it does not know."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    JobsOption,
    JsonOption,
    OutOption,
    QuietOption,
    SchedulerOption,
    command_line,
)


@ends_with_code
def blind(
    trials: Annotated[int, typer.Option("--trials", min=1, help="Campaigns to draw.")] = 60,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            help="Of all that is drawn; a secret one, or that of --out DIR, if not given.",
            show_default=False,
        ),
    ] = None,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="RIG", help="Drawing of the rig; the shipped one by default."),
    ] = None,
    shares: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            "--shares",
            metavar="NONE ONE TWO UNKNOWN",
            help="How often nothing, one effect, two, or one that is removed from the catalogue;"
            " 20 50 15 15 by default, with --foreign 30 70 0 0.",
            show_default=False,
        ),
    ] = None,
    every: Annotated[
        int, typer.Option("--every", min=1, help="Record every so many dwells only: quicker, harder.")
    ] = 1,
    sweep: Annotated[bool, typer.Option("--sweep", help="Record a sweep of a minute, too.")] = False,
    foreign: Annotated[
        bool,
        typer.Option(
            "--foreign",
            help="Effects follow laws that the diagnosis does not have, on rigs with small errors.",
        ),
    ] = False,
    again: Annotated[
        bool,
        typer.Option(
            "--again", help="Diagnose the recordings in --out DIR anew; the marks there are replaced."
        ),
    ] = False,
    sensitivity: Annotated[
        bool,
        typer.Option(
            "--sensitivity",
            help="Verdicts by decision constants halved and doubled, too, for every new trial.",
        ),
    ] = False,
    out: OutOption = Path("out/blind"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Try the diagnosis on campaigns whose effect is withheld, and count how often it is right.

    A rig is drawn in secret: its parameters within their tolerances, with nothing missing, one effect, two, or one
    that is removed from the catalogue. Its campaign is simulated in time, with noise; the answer is sealed; the
    diagnosis gets the recordings; then the seal is opened. Takes minutes a trial.

    With --foreign nothing is missing, or one effect by a law that the diagnosis does not have (LuGre, Bouc-Wen, cubic
    stiffness, digressive damping, filters of second order and others). Every rig is off its sheet, its damper's table
    is off point by point, its friction drifts, noise is coloured, and the road's phase is slightly wrong.

    Writes blind.json, blind.html, confusion.png, confusion.pdf, reliability.png, reliability.pdf, trials.jsonl, and a
    folder a trial. A run that was stopped goes on where it was when it is started again.

    Exit code 1 if the diagnosis is not right as often as it should be.

    Example: savgs-ident blind --trials 60 --seed 1

    Example: savgs-ident blind --foreign --trials 60 --seed 1
    """
    import savgs_ident as si

    reporter = Reporter(json, quiet)
    with reporter.working() as progress:
        study = si.blind(
            out,
            trials,
            seed=seed,
            rig=rig,
            shares=shares,
            every=every,
            sweep=sweep,
            foreign=foreign,
            again=again,
            sensitivity=sensitivity,
            jobs=jobs,
            scheduler=scheduler,
            command=command_line(),
            progress=progress,
        )
        files = study.save(out, progress)
    return reporter.conclude(study, (*files, out / "trials.jsonl"))
