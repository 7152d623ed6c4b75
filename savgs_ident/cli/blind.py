"""``savgs-ident blind``: how often the diagnosis is right about effects that it does not know."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    BaselineOption,
    ChannelsOption,
    JobsOption,
    JsonOption,
    MaxFrequencyOption,
    OrdersOption,
    OutOption,
    PlantOption,
    QuietOption,
    SchedulerOption,
    baseline_model,
    command_line,
    read_recorded,
)


@ends_with_code
def blind(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            metavar="[CAMPAIGN]",
            help="What the trials are to be like: a file or folder of recordings, of any plant. Without it they are"
            " campaigns of the rig that are simulated in time.",
            show_default=False,
        ),
    ] = None,
    plant: PlantOption = QUARTER_CAR,
    trials: Annotated[int, typer.Option("--trials", min=1, help="Campaigns to draw.")] = 60,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            help="Of all that is drawn; a secret one, or that of --out DIR, if not given; with CAMPAIGN 1.",
            show_default=False,
        ),
    ] = None,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    rig: Annotated[
        Path | None,
        typer.Option(
            "--rig",
            metavar="RIG",
            help="Drawing of the rig, the shipped one by default; with CAMPAIGN the model.toml of a fit, too.",
        ),
    ] = None,
    model: BaselineOption = None,
    shares: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            "--shares",
            metavar="NONE ONE TWO UNKNOWN",
            help="How often nothing, one effect, two, or one that is removed from the catalogue;"
            " 20 50 15 15 by default, with --foreign 30 70 0 0, with CAMPAIGN 25 60 15 0.",
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
    max_frequency: MaxFrequencyOption = None,
    orders: OrdersOption = 9,
    channels: ChannelsOption = None,
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

    With CAMPAIGN, and --plant for another plant than the rig, the trials are campaigns like that one: the model is
    recalibrated on it, and its tests, its noise and parameters within what it leaves open are drawn from it, with
    nothing missing, or one or two effects of the plant's catalogue. How often would a diagnosis of such recordings be
    right? Give it a model that explains CAMPAIGN.

    Writes blind.json, blind.html, confusion.png, confusion.pdf, reliability.png, reliability.pdf and trials.jsonl;
    without CAMPAIGN a folder a trial, too. A run that was stopped goes on where it was when it is started again.

    Exit code 1 if the diagnosis is not right as often as it should be.

    Example: savgs-ident blind --trials 60 --seed 1

    Example: savgs-ident blind --foreign --trials 60 --seed 1

    Example: savgs-ident blind roads.csv.gz --plant bench.py:Bench --trials 20
    """
    import savgs_ident as si

    reporter = Reporter(json, quiet)
    with reporter.working() as progress:
        if campaign is None:
            _refuse_with_trials_in_time(plant, model, max_frequency, channels)
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
        else:
            _refuse_with_a_campaign(
                every=every > 1, sweep=sweep, foreign=foreign, again=again, sensitivity=sensitivity
            )
            baseline = baseline_model(plant, rig, model, ())
            study = si.blind_like(
                baseline,
                read_recorded(campaign, channels, progress, baseline),
                out,
                trials,
                seed=1 if seed is None else seed,
                shares=shares,
                orders=orders,
                max_frequency=max_frequency,
                channels=channels,
                jobs=jobs,
                scheduler=scheduler,
                command=command_line(),
                progress=progress,
            )
        files = study.save(out, progress)
    return reporter.conclude(study, (*files, out / "trials.jsonl"))


def _refuse_with_trials_in_time(plant: str, *given: object) -> None:
    """Raise :class:`InputError` for what campaigns that are simulated in time do not have."""
    from savgs_ident import InputError

    if plant != QUARTER_CAR:
        raise InputError(
            f"trials of {plant} need a CAMPAIGN whose tests and noise they are to have",
            remedy="name a recording: savgs-ident blind roads.csv.gz --plant bench.py:Bench",
        )
    if any(each is not None for each in given):
        raise InputError(
            "--model, --max-frequency and --channels go with a CAMPAIGN that trials are to be like",
            remedy="leave them out, or name a campaign",
        )


def _refuse_with_a_campaign(**given: bool) -> None:
    """Raise :class:`InputError` for options of campaigns that are simulated in time."""
    from savgs_ident import InputError

    for name, asked in given.items():
        if asked:
            raise InputError(
                f"--{name} is of campaigns that are simulated in time, not of trials like a CAMPAIGN",
                remedy="leave it out, or leave the campaign out",
            )
