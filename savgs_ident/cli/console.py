"""What a command says, and where: results to standard output, everything else to standard error.

With ``--json`` standard output carries the JSON object and nothing else; with ``--quiet`` the tables and the
progress are left out, errors and the reason for a mistrusted result are not.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console, RenderableType
from rich.status import Status
from rich.text import Text

from savgs_ident.report.files import json_bytes
from savgs_ident.report.terminal import plain


@dataclass(frozen=True)
class Voice:
    """How a command speaks: ``json`` instead of tables, ``quiet`` without progress and tables."""

    json: bool
    quiet: bool

    def show(self, *parts: RenderableType) -> None:
        """Print tables and sentences for people to standard output."""
        if self.json or self.quiet:
            return
        console = Console(highlight=False, soft_wrap=not sys.stdout.isatty())
        with console.capture() as captured:
            for part in parts:
                console.print(part)
        sys.stdout.write(captured.get())
        sys.stdout.flush()

    def hand_over(self, record: object) -> None:
        """Print the result as JSON to standard output, if that was asked for."""
        if self.json:
            # JSON is UTF-8 whatever the terminal speaks, byte for byte what is in the file.
            sys.stdout.flush()
            sys.stdout.buffer.write(json_bytes(record))
            sys.stdout.buffer.flush()

    @contextmanager
    def working(self) -> Iterator["Progress"]:
        """A progress line on standard error for as long as the work takes."""
        console = Console(stderr=True, highlight=False)
        if self.quiet:
            yield Progress(None, None)
        elif console.is_terminal:
            with console.status(plain("starting")) as status:
                yield Progress(console, status)
        else:
            yield Progress(console, None)


@dataclass(frozen=True)
class Progress:
    """A line that says what is happening: it changes in place on a terminal, and is appended elsewhere."""

    console: Console | None
    status: Status | None

    def __call__(self, message: str) -> None:
        """Say what is being done now."""
        if self.status is not None:
            self.status.update(_line(message))
        elif self.console is not None:
            self.console.print(_line(message), soft_wrap=True)

    def fraction(self, message: str) -> "FractionTold":
        """A listener for fractions done, 0 to 1, that says ``message`` with a percentage."""
        return FractionTold(self, message)


@dataclass(frozen=True)
class FractionTold:
    """Says a message with the percentage done; without a terminal, the message is left to the first call."""

    progress: Progress
    message: str

    def __call__(self, fraction: float) -> None:
        """Take note that a ``fraction`` of the work [1] is done."""
        if self.progress.status is not None:
            self.progress(f"{self.message} ({100.0 * fraction:.0f} %)")


def complain(message: str) -> None:
    """One line to standard error, whatever was asked for."""
    Console(stderr=True, highlight=False).print(_line(message), soft_wrap=True)


def _line(message: str) -> Text:
    """``message`` in one line, whatever is in the names that it tells."""
    return plain(message.replace("\n", "\\n"))
