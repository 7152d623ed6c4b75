"""Arguments and options that several commands share, and what they mean.

Options that take several values at once are written ``--free mu_r c_sd`` for ``--free mu_r --free c_sd``.
"""

import sys
from collections.abc import Callable, Sequence
from enum import StrEnum
from functools import reduce
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from savgs_ident.cli.console import Progress

if TYPE_CHECKING:
    from savgs_ident import Campaign, DrivenMotion, Model, PlantModel


class ModelName(StrEnum):
    """The paper's models."""

    simqc = "simqc"
    simtr = "simtr"


class SamplerName(StrEnum):
    """The samplers there are."""

    emcee = "emcee"
    nuts = "nuts"


CampaignArgument = Annotated[
    Path,
    typer.Argument(
        metavar="CAMPAIGN", help="CSV (plain or .gz) or MCAP file, or a folder of them.", show_default=False
    ),
]
ModelArgument = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL", help="Rig file: a model.toml that `fit` wrote, or a drawing.", show_default=False
    ),
]
PlantOption = Annotated[
    str,
    typer.Option(
        "--plant",
        metavar="PLANT",
        help="quarter_car: the rig. axis: a servo axis. two_mass: the linear quarter car. FILE.py:CLASS: a plant of "
        "your own, see `savgs-ident check-plant`.",
    ),
]
ChannelsOption = Annotated[
    Path | None,
    typer.Option("--channels", metavar="FILE", help="channels.toml that says which column or topic is what."),
]
RigOption = Annotated[
    Path | None,
    typer.Option(
        "--rig",
        metavar="FILE",
        help="Rig file to start from, the shipped one by default; for another plant a model.toml with its numbers.",
    ),
]
ModelOption = Annotated[
    ModelName | None,
    typer.Option(
        "--model",
        help="simtr: with rail and tyre friction, the default; simqc: without. Of the quarter car alone.",
    ),
]
WithOption = Annotated[
    list[str] | None,
    typer.Option(
        "--with", metavar="EFFECT ...", help="Effects that the model has besides, as a diagnosis names them."
    ),
]
BaselineOption = Annotated[
    ModelName | None,
    typer.Option(
        "--model",
        help="simtr: with rail and tyre friction, the default for a drawing; simqc: without. "
        "A model.toml brings its own. Of the quarter car alone.",
    ),
]
EffectsOption = Annotated[
    ModelName | None,
    typer.Option("--model", help="simtr or simqc; by default what the file was identified with."),
]
FreeOption = Annotated[
    list[str] | None,
    typer.Option("--free", metavar="NAME ...", help="Parameters to identify instead of the paper's four."),
]
FixedTolerancesOption = Annotated[
    bool, typer.Option("--fixed-tolerances", help="Hold what is known to a tolerance at its value.")
]
MaxFrequencyOption = Annotated[
    float | None,
    typer.Option(
        "--max-frequency",
        metavar="HZ",
        help="Leave out faster dwells. In windows: compare up to this; by default 15 Hz, and 40 Hz at most, for a "
        "plant as fast as a quarter car.",
    ),
]
OrdersOption = Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to compare.")]
FitOrdersOption = Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to fit.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Of all random numbers.")]
SchedulerOption = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Dask cluster to work on instead of this machine."),
]
JobsOption = Annotated[
    int | None,
    typer.Option(
        "--jobs", min=1, help="Trials at a time; one for each core if not given.", show_default=False
    ),
]
HeldOutOption = Annotated[
    Path | None,
    typer.Option(
        "--held-out",
        metavar="FILE",
        help="Another motion along the drive, which is predicted and compared.",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No progress and no tables.")]


def command_line() -> tuple[str, ...]:
    """The command as it was typed."""
    return ("savgs-ident", *sys.argv[1:])


QUARTER_CAR = "quarter_car"
"""The plant that commands are about where none is named."""


def model_to_fit(plant: str, rig: Path | None, model: ModelName | None, beside: Sequence[str]) -> "Model":
    """The model that a fit starts from, with the effects ``beside`` its own.

    Raises :class:`InputError` for a plant or a file that cannot be read, and for options that do not go together.
    """
    import savgs_ident as si

    if plant == QUARTER_CAR:
        return reduce(add, beside, si.load_model(rig, effects_of(model or ModelName.simtr)))
    return reduce(add, beside, _of_other_plant(plant, rig, model))


def baseline_model(plant: str, rig: Path | None, model: ModelName | None, beside: Sequence[str]) -> "Model":
    """The baseline of a diagnosis, with the effects ``beside`` its own; raises as :func:`model_to_fit` does."""
    import savgs_ident as si

    if plant == QUARTER_CAR:
        return reduce(add, beside, si.load_baseline(rig, effects_of(model)))
    return reduce(add, beside, _of_other_plant(plant, rig, model))


def identified_model(plant: str, path: Path, model: ModelName | None = None) -> "Model":
    """The model of a file that a fit wrote; raises :class:`InputError` as :func:`model_to_fit` does."""
    import savgs_ident as si

    return (
        si.load_model(path, effects_of(model))
        if plant == QUARTER_CAR
        else _of_other_plant(plant, path, model)
    )


def _of_other_plant(plant: str, rig: Path | None, model: ModelName | None) -> "PlantModel":
    import savgs_ident as si

    check_model(plant, model)
    return si.load_plant(plant, rig)


def check_model(plant: str, model: ModelName | None) -> None:
    """Raise :class:`InputError` for one of the paper's models of another plant than the quarter car."""
    import savgs_ident as si

    if model is not None and plant != QUARTER_CAR:
        raise si.InputError(
            f"--model {model.value} is of the quarter car, not of {plant}",
            remedy="leave it out; --with adds effects",
        )


def read_campaign(
    path: Path, channels: Path | None, progress: Progress, model: "Model | None" = None
) -> "Campaign":
    """The campaign of a file or folder, in the channels of the model's plant, or of the rig where none is given.

    Raises :class:`InputError` for one that cannot be read.
    """
    import savgs_ident as si

    progress(f"reading {path}")
    told = progress.fraction(f"reading {path}")
    if model is None:
        return si.load_campaign(path, channels, progress=told)
    return si.load_campaign(path, channels, layout=model.layout, progress=told)


def read_recorded(
    path: Path, channels: Path | None, progress: Progress, model: "Model"
) -> "Campaign | DrivenMotion":
    """A campaign, or the motion of a servo axis where a MATLAB file holds one.

    Raises :class:`InputError` for what cannot be read.
    """
    import savgs_ident as si

    if not si.is_motion(path):
        return read_campaign(path, channels, progress, model)
    progress(f"reading {path}")
    return si.load_motion(path)


def numbers_by_name(option: str, words: Sequence[str]) -> dict[str, float]:
    """Values like ``angle=0.002`` by name; raises :class:`typer.BadParameter` for another word."""
    return {name: numbers[-1] for name, numbers in several_by_name(option, words).items()}


def several_by_name(option: str, words: Sequence[str]) -> dict[str, list[float]]:
    """The same where a name may have several values."""
    found: dict[str, list[float]] = {}
    for word in words:
        if not _is_named_number(word):
            raise typer.BadParameter(f"'{word}' is no NAME=NUMBER, such as angle=0.002", param_hint=option)
        name, _, number = word.partition("=")
        found.setdefault(name, []).append(float(number))
    return found


def effects_of(model: ModelName | None) -> Literal["simqc", "simtr"] | None:
    """What an option says of the effects; None where it is left out."""
    return None if model is None else model.value


def _is_name(word: str) -> bool:
    return word.isidentifier() and not Path(word).exists()


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _is_named_number(word: str) -> bool:
    name, _, number = word.partition("=")
    return name.isidentifier() and _is_number(number)


def _is_format(word: str) -> bool:
    return word[:1] != "-" and word.replace("-", "_").isidentifier() and not Path(word).exists()


SEVERAL: dict[str, Callable[[str], bool]] = {
    "--free": _is_name,
    "--with": _is_name,
    "--without": _is_name,
    "--frequency": _is_number,
    "--amplitude": _is_number,
    "--noise": _is_named_number,
    "--level": _is_named_number,
    "--to": _is_format,
}
"""The options, and what a further value of each looks like; a word that does not is an argument."""


def spread_values(words: Sequence[str]) -> list[str]:
    """The command line with the option repeated before each of its further values.

    >>> spread_values(["fit", "--free", "mu_r", "c_sd", "--quiet", "run.csv"])
    ['fit', '--free', 'mu_r', '--free', 'c_sd', '--quiet', 'run.csv']
    """
    out: list[str] = []
    option, first = "", False
    for word in words:
        if word in SEVERAL:
            option, first = word, True
        elif option and first and not word.startswith("--"):
            first = False
        elif option and not first and SEVERAL[option](word):
            out.append(option)
        else:
            option = ""
        out.append(word)
    return out
