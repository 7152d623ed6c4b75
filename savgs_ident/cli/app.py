"""The program ``savgs-ident``: one command a task, each in a file of its own.

Commands import what they need when they run, so that ``savgs-ident --help`` answers at once.
"""

import atexit
import ctypes
import gc
import os
import signal
import sys
from collections.abc import Iterable
from contextlib import suppress
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from savgs_ident import __version__
from savgs_ident.cli.blind import blind
from savgs_ident.cli.bode import bode
from savgs_ident.cli.calibrate import calibrate
from savgs_ident.cli.campaign import campaign
from savgs_ident.cli.check_plant import check_plant
from savgs_ident.cli.closed_loop import closed_loop
from savgs_ident.cli.console import mend_streams, print_error, refused
from savgs_ident.cli.demo import demo
from savgs_ident.cli.design import design
from savgs_ident.cli.diagnose import diagnose
from savgs_ident.cli.export import export
from savgs_ident.cli.false_alarms import false_alarms
from savgs_ident.cli.fit import fit
from savgs_ident.cli.inspect import inspect
from savgs_ident.cli.linearise import linearise
from savgs_ident.cli.options import spread_values
from savgs_ident.cli.plan import plan
from savgs_ident.cli.posterior import posterior
from savgs_ident.cli.simulate import simulate

# Typer has a name for this one only: its base is Click's, or that of a copy of Click, depending on the version.
_UsageError = cast("type[typer.BadParameter]", typer.BadParameter.__base__)


class Commands(TyperGroup):
    """The commands of the program.

    Errors of usage are one line with its remedy, as all others::

        Error: Missing argument 'CAMPAIGN'. Remedy: see savgs-ident fit --help.
    """

    def main(self, *args: Any, **options: Any) -> Any:
        """Run the command that the words name, and end the process."""
        try:
            code = super().main(*args, **options | {"standalone_mode": False})
        except _UsageError as error:
            code = error.exit_code
            message = error.format_message()
            if message:  # Without any word the help has been shown, and that is all there is to say.
                sentence = message if message.endswith("?") else f"{message.rstrip('.')}."
                print_error(f"Error: {sentence} Remedy: see {self._asked(error, options)} --help.")
        except OSError as error:
            code = refused(error)
        sys.exit(code)

    def _asked(self, error: typer.BadParameter, options: dict[str, Any]) -> str:
        """The program and the command; the parser does not say which where an option lacks its value."""
        if error.ctx is not None:
            return error.ctx.command_path
        words: Iterable[str] = options.get("args") or ()
        return " ".join([str(self.name), *[word for word in words if word in self.commands][:1]])


app = typer.Typer(
    name="savgs-ident",
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"savgs-ident {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Identify a quarter-car suspension rig from its recordings.

    Exit codes: 0 ok; 1 ran, but the result is not to be trusted; 2 bad input or usage; 130 stopped.
    """


for _command in (
    demo, inspect, fit, bode, simulate, posterior, calibrate, diagnose, false_alarms, blind, linearise, design,
    closed_loop, export, campaign, check_plant, plan,
):  # fmt: skip
    app.command()(_command)


_ARENA_MAX = -8
"""``M_ARENA_MAX`` of glibc."""

_ARENAS_PER_CORE = 4
"""Half of what glibc takes by itself: a diagnosis needs 8 % less memory, and no more time; a quarter costs time."""


def _share_memory() -> None:
    """Let threads share the memory that others let go: the C library of Linux keeps it for each by itself."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).mallopt(_ARENA_MAX, _ARENAS_PER_CORE * (os.cpu_count() or 1))


def run() -> None:
    """Run the program on the arguments of the process."""
    # Loading libraries and tracing models makes a million objects, nearly all of which stay. Looking for garbage
    # among them, at the usual pace and once more at the end, takes a sixth of the time that a fit takes.
    gc.set_threshold(100_000, 20, 100)
    atexit.register(gc.freeze)
    _share_memory()
    mend_streams()
    try:
        app(args=spread_values(sys.argv[1:]))
    finally:
        # The end is near; another Ctrl-C could only spoil it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
