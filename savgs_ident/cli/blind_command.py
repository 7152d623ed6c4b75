"""``savgs-ident blind``: how often the diagnosis is right about effects that it was not told of."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.options import JsonOption, QuietOption


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
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", min=1, help="Trials at a time; one for each core if not given.", show_default=False
        ),
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="RIG", help="Drawing of the rig; the shipped one by default."),
    ] = None,
    shares: Annotated[
        tuple[float, float, float, float],
        typer.Option(
            "--shares",
            metavar="NONE ONE TWO UNKNOWN",
            help="How often nothing, one effect, two, or one that is removed from the catalogue.",
        ),
    ] = (20.0, 50.0, 15.0, 15.0),
    every: Annotated[
        int, typer.Option("--every", min=1, help="Record every so many dwells only: quicker, harder.")
    ] = 1,
    sweep: Annotated[bool, typer.Option("--sweep", help="Record a sweep of a minute, too.")] = False,
    again: Annotated[
        bool,
        typer.Option("--again", help="Diagnose the recordings in --out DIR anew; keep none of the marks."),
    ] = False,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/blind"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Try the diagnosis on campaigns whose effect is withheld, and count how often it is right.

    A rig is drawn in secret: its parameters within their tolerances, with nothing missing, one effect, two, or one
    that is removed from the catalogue. Its campaign is simulated in time, with noise; the answer is sealed; the
    diagnosis gets the recordings; then the seal is opened. Takes minutes a trial.

    Writes blind.json, blind.html, confusion.png, confusion.pdf, trials.jsonl, and a folder a trial. A run that was
    stopped goes on where it was when it is started again.

    Exit code 1 if the diagnosis is not right as often as it should be.

    Example: savgs-ident blind --trials 60 --seed 1
    """
    # Checks that call back into Python from a compiled program would keep it from being kept for the next run; a
    # failed one gives NaN then, which is looked for. Has to be said before the libraries are loaded.
    os.environ.setdefault("EQX_ON_ERROR", "nan")
    from savgs_ident.cli.blind_trial import diagnose_folder, draw_and_record
    from savgs_ident.cli.blinding import Job, run_blind

    command = ("savgs-ident", *sys.argv[1:])
    job = Job(trials, seed, jobs or os.cpu_count() or 1, rig, shares, every, sweep, again, command)
    return run_blind(job, draw_and_record, diagnose_folder, Voice(json, quiet), out)
