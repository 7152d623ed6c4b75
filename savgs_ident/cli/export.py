"""``savgs-ident export``: an identified model in the forms that other tools read."""

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
    command_line,
    effects_of,
    identified_model,
)


@ends_with_code
def export(
    model_file: ModelArgument,
    *,
    plant: PlantOption = QUARTER_CAR,
    to: Annotated[
        list[str],
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="json, mat, python-control, casadi, c or fmu; several may be given.",
            show_default=False,
        ),
    ],
    posterior: Annotated[
        Path | None,
        typer.Option("--posterior", metavar="FILE", help="posterior.nc, whose draws travel along."),
    ] = None,
    samples: Annotated[
        int, typer.Option("--samples", metavar="N", min=1, help="How many draws, evenly spread over all.")
    ] = 500,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            "--diagnosis",
            metavar="FILE",
            help="diagnosis.json: the effects that it names, or the force that it learned, join the model with "
            "the numbers of its fit.",
        ),
    ] = None,
    model: EffectsOption = None,
    out: OutOption = Path("out/export"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Export an identified model: parameters with covariance, draws, linear models, equations.

    The effects that a diagnosis names join the model, and so does the force that it learned for something unknown.
    Where it learned none, what it found travels along as data and the equations are without it.

    Writes export.json (what was written, and where the numbers come from), and for json model.json, for mat
    model.mat, for python-control model-control.json, for casadi and c the functions and signals.json, for fmu
    savgs_rig.fmu.

    Exit code 1 if the model was written but is not to be trusted: its fit or diagnosis did not converge, or the
    posterior is not one of this model.

    Example: savgs-ident export out/fit/model.toml --to json mat --posterior out/posterior/posterior.nc
    """
    import savgs_ident as si

    reporter = Reporter(json, quiet)
    # A rig file is taken with the effects of the diagnosis, so it goes there as it is.
    exported_model = model_file if plant == QUARTER_CAR else identified_model(plant, model_file, model)
    with reporter.working() as progress:
        exported = si.export(
            exported_model,
            to,
            out,
            effects=effects_of(model),
            posterior=posterior,
            samples=samples,
            diagnosis=diagnosis,
            command=command_line(),
            progress=progress,
        )
        files = exported.save(out, progress)
    return reporter.conclude(exported, files)
