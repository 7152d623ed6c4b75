"""The program ``savgs-ident``: one command a task, each in a file of its own.

Commands import what they need when they run, so that ``savgs-ident --help`` answers at once.
"""

import atexit
import gc
import signal
import sys
from typing import Annotated

import typer

from savgs_ident import __version__
from savgs_ident.cli.alarms_command import false_alarms
from savgs_ident.cli.arguments import spread_values
from savgs_ident.cli.blind_command import blind
from savgs_ident.cli.bode_command import bode
from savgs_ident.cli.calibrate_command import calibrate
from savgs_ident.cli.campaign_command import campaign
from savgs_ident.cli.closed_loop_command import closed_loop
from savgs_ident.cli.design_command import design
from savgs_ident.cli.diagnose_command import diagnose
from savgs_ident.cli.export_command import export
from savgs_ident.cli.fit_command import demo, fit
from savgs_ident.cli.inspect_command import inspect
from savgs_ident.cli.linearise_command import linearise
from savgs_ident.cli.posterior_command import posterior
from savgs_ident.cli.simulate_command import simulate
from savgs_ident.cli.streams import mend_streams
from savgs_ident.cli.usage import Commands

app = typer.Typer(
    name="savgs-ident",
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"savgs-ident {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Identify a quarter-car suspension rig from its recordings.

    Exit codes: 0 ok; 1 ran, but the result is not to be trusted; 2 bad input or usage; 130 stopped.
    """


for _command in (
    demo, inspect, fit, bode, simulate, posterior, calibrate, diagnose, false_alarms, blind, linearise, design,
    closed_loop, export, campaign,
):  # fmt: skip
    app.command()(_command)


def run() -> None:
    """Run the program on the arguments of the process."""
    # Loading libraries and tracing models makes a million objects, nearly all of which stay. Looking for garbage
    # among them, at the usual pace and once more at the end, takes a sixth of the time that a fit takes.
    gc.set_threshold(100_000, 20, 100)
    atexit.register(gc.freeze)
    mend_streams()
    try:
        app(args=spread_values(sys.argv[1:]))
    finally:
        # The end is near; another Ctrl-C could only spoil it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
