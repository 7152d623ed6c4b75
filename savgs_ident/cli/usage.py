"""Errors of usage as all others: one line with its remedy, instead of a box of several.

Error: Missing argument 'CAMPAIGN'. Remedy: see savgs-ident fit --help.
"""

import sys
from collections.abc import Iterable
from typing import Any, cast

import typer
from typer.core import TyperGroup

from savgs_ident.cli.console import complain
from savgs_ident.cli.guard import code_of_refusal

# Typer has a name for this one only: its base is Click's, or that of a copy of Click, depending on the version.
_UsageError = cast("type[typer.BadParameter]", typer.BadParameter.__base__)


class Commands(TyperGroup):
    """The commands of the program, which end as :mod:`savgs_ident.cli.guard` says, whatever is asked of them."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Run the command that the words name, and end the process."""
        try:
            code = super().main(*args, **options | {"standalone_mode": False})
        except _UsageError as error:
            code = error.exit_code
            told = error.format_message()
            if told:  # Without any word the help has been shown, and that is all there is to say.
                sentence = told if told.endswith("?") else f"{told.rstrip('.')}."
                complain(f"Error: {sentence} Remedy: see {self._asked(error, options)} --help.")
        except OSError as error:
            code = code_of_refusal(error)
        sys.exit(code)

    def _asked(self, error: typer.BadParameter, options: dict[str, Any]) -> str:
        """The program and the command; the parser does not say which where an option lacks its value."""
        if error.ctx is not None:
            return error.ctx.command_path
        words: Iterable[str] = options.get("args") or ()
        return " ".join([str(self.name), *[word for word in words if word in self.commands][:1]])
