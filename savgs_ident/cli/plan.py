"""``savgs-ident plan``: which dwells to record."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    FreeOption,
    JsonOption,
    ModelOption,
    OutOption,
    PlantOption,
    QuietOption,
    RigOption,
    WithOption,
    command_line,
    model_to_fit,
    numbers_by_name,
    several_by_name,
)


@ends_with_code
def plan(
    plant: PlantOption = QUARTER_CAR,
    rig: RigOption = None,
    model: ModelOption = None,
    beside: WithOption = None,
    free: FreeOption = None,
    frequency: Annotated[
        list[float] | None,
        typer.Option(
            "--frequency",
            metavar="HZ ...",
            help="Frequencies to choose among [Hz]; by default the rig's, or some about the natural ones.",
        ),
    ] = None,
    amplitude: Annotated[
        list[float] | None,
        typer.Option(
            "--amplitude",
            metavar="SIZE ...",
            help="Amplitudes of the first input to choose among [its unit]; the typical one by default.",
        ),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            "--noise",
            metavar="CHANNEL=SD ...",
            help="Standard deviation of one sample of a channel [its unit]; a hundredth of its motion by default.",
        ),
    ] = None,
    level: Annotated[
        list[str] | None,
        typer.Option(
            "--level",
            metavar="INPUT=LEVEL ...",
            help="Levels above rest of further inputs to choose among [their units], such as current=0.5 current=1; "
            "half the typical one and the whole by default.",
        ),
    ] = None,
    tests: Annotated[int, typer.Option("--tests", min=1, help="Most dwells of the campaign.")] = 12,
    error: Annotated[
        float, typer.Option("--error", min=0.0, help="Standard error wanted of the free parameters [%].")
    ] = 2.0,
    out: OutOption = Path("out/plan"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Plan a campaign: which dwells identify the free parameters, and tell effects of the catalogue apart.

    Dwells are chosen one after the other among all frequencies and amplitudes, each the one that helps most: until
    the parameters are known well enough, then to tell effects apart. What the campaign would not show is said.

    Writes plan.json, plan.csv (the dwells), plan.png and plan.pdf.

    Exit code 1 if no such campaign identifies every free parameter as well as is wanted.

    Example: savgs-ident plan --tests 8 --error 1

    Example: savgs-ident plan --plant servo.py --amplitude 1 4 --noise angle=0.002 current=0.02
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    start = model_to_fit(plant, rig, model, beside or ())
    with reporter.working() as progress:
        found = si.plan(
            start,
            free=free or (),
            frequencies=frequency or (),
            amplitudes=amplitude or (),
            noise=numbers_by_name("--noise", noise or ()),
            levels=several_by_name("--level", level) if level else None,
            tests=tests,
            target=error / 100.0,
            command=command_line(),
            progress=progress,
        )
        files = found.save(out, progress)
    return reporter.conclude(found, files)
