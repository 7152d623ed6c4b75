"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

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
ChannelsOption = Annotated[
    Path | None,
    typer.Option("--channels", metavar="FILE", help="channels.toml that says which column or topic is what."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No progress and no tables.")]
