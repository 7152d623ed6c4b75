"""``savgs-ident linearise``: the linear models of a rig, and how far each is from the rig."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice
from savgs_ident.cli.guard import ends_with_code
from savgs_ident.cli.models import ModelName
from savgs_ident.cli.options import JsonOption, ModelArgument, QuietOption


@ends_with_code
def linearise(
    model_file: ModelArgument,
    model: Annotated[
        ModelName | None,
        typer.Option("--model", help="simtr or simqc; by default what the file was identified with."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/linearise"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Linearise a model: stiffness, damping and link at the wheel, and how far linear models are from the rig.

    The linear equivalent over the link angle with the constants and parabolas that stand for it; equation (8) of
    the paper and the exact linearisation against the nonlinear model at small motions; friction and damper as
    describing functions at the size of the test.

    Writes linearise.json (with the state space of equation (8)), linearise.html (the report), and as .png and
    .pdf alpha, responses and, with friction, described.

    Exit code 1 if the exact linearisation is not the nonlinear model at small motions.

    Example: savgs-ident linearise out/fit/model.toml
    """
    from savgs_ident.cli.linearising import Job, run_linearisation

    command = ("savgs-ident", *sys.argv[1:])
    return run_linearisation(Job(model_file, model, command), Voice(json, quiet), out)
