"""``savgs-ident check-plant``: whether a plant of one's own is one."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import JsonOption, OutOption, QuietOption


@ends_with_code
def check_plant(
    plant: Annotated[
        str,
        typer.Argument(
            metavar="PLANT",
            help="FILE.py:CLASS, or FILE.py where it has one plant only; axis or two_mass.",
            show_default=False,
        ),
    ],
    rig: Annotated[
        Path | None,
        typer.Option(
            "--rig", metavar="FILE", help="A model.toml with numbers of the plant, instead of its own."
        ),
    ] = None,
    out: OutOption = Path("out/check-plant"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Check a plant of your own: what it declares, its equations, its motions, what its recordings can tell.

    Names, units and sizes are held against each other. Equations are evaluated at random instants: whether
    accelerations follow from them, a force at a port pulls its own way, slopes are those of differences, effects at
    their null change nothing. Motions are solved about the resonances: whether there are any, which parameters move
    nothing, and which no test can tell apart.

    Writes check-plant.json.

    Exit code 1 if a fault was found.

    Example: savgs-ident check-plant pendulum.py:Pendulum
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    model = si.load_plant(plant, rig)
    with reporter.working() as progress:
        found = si.check_plant(model, progress)
        files = found.save(out, progress)
    return reporter.conclude(found, files)
