"""How commands end: exit codes, and errors as a sentence instead of a traceback.

0 ok; 1 ran, but the result is not to be trusted; 2 bad input or usage; 130 stopped by Ctrl-C.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec

import typer

from savgs_ident.cli.console import complain
from savgs_ident.core.errors import InputError

OK = 0
NOT_TRUSTED = 1
BAD_INPUT = 2
INTERRUPTED = 130

Arguments = ParamSpec("Arguments")


def ends_with_code(command: Callable[Arguments, int]) -> Callable[Arguments, None]:
    """The command, whose returned code becomes the exit code and whose expected errors become one line."""

    @wraps(command)
    def guarded(*args: Arguments.args, **kwargs: Arguments.kwargs) -> None:
        raise typer.Exit(_code_of(lambda: command(*args, **kwargs)))

    return guarded


def _code_of(work: Callable[[], int]) -> int:
    try:
        return work()
    except KeyboardInterrupt:
        complain("Stopped by Ctrl-C; files that were finished are kept.")
        return INTERRUPTED
    except InputError as error:
        complain(f"Error: {error}")
        return BAD_INPUT
    except OSError as error:
        return code_of_refusal(error)


def code_of_refusal(error: OSError) -> int:
    """Say what the system refused, in one line; the exit code."""
    place = f"{error.filename}: " if error.filename else ""
    complain(f"Error: {place}{error.strerror or error}. Remedy: check the path, its permissions, the disk.")
    return BAD_INPUT
