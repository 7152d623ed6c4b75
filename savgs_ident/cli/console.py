"""What a command says, where, and how it ends.

Results go to standard output, everything else to standard error. With ``--json`` standard output carries the JSON
object and nothing else; with ``--quiet`` the tables and the progress are left out, errors and the reason for a
mistrusted result are not.

A command ends with 0 ok; 1 ran, but the result is not to be trusted; 2 bad input or usage; 130 stopped by Ctrl-C; and
with a sentence instead of a traceback.

Standard output and standard error are taken as they may be: closed, full, left by their reader, without Unicode. No
run ends, and no exit code changes, because nobody listens: what cannot be said is left unsaid. Only a full disk under
standard output is an error, for what is missing there is a part of the result.
"""

import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, ParamSpec, TextIO

import typer
from rich.console import Console, RenderableType
from rich.status import Status

from savgs_ident.core.errors import InputError
from savgs_ident.core.threads import beside
from savgs_ident.report.text import plain

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

    from _typeshed import ReadableBuffer

    from savgs_ident.core.presentation import Result

OK = 0
NOT_TRUSTED = 1
BAD_INPUT = 2
INTERRUPTED = 130

Arguments = ParamSpec("Arguments")

_PRESSED = threading.Event()
"""Ctrl-C in the command that runs. A library that is being imported may let no exception pass: the next line of
progress raises it again."""


@dataclass(frozen=True)
class Progress:
    """A line that says what is happening: it changes in place on a terminal, and is appended elsewhere."""

    console: Console | None
    status: Status | None

    def __call__(self, message: str) -> None:
        """Say what is being done now; raises ``KeyboardInterrupt`` once Ctrl-C was pressed."""
        if _PRESSED.is_set():
            raise KeyboardInterrupt
        if self.status is not None:
            self.status.update(_line(message))
        elif self.console is not None:
            self.console.print(_line(message), soft_wrap=True)

    def fraction(self, message: str) -> Callable[[float], None]:
        """A listener for fractions done, 0 to 1, that says ``message`` with a percentage.

        Without a terminal nothing is said, for the message has been.
        """

        def report(done: float) -> None:
            if self.status is not None:
                self(f"{message} ({100.0 * done:.0f} %)")

        return report


@dataclass(frozen=True)
class Reporter:
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

    def conclude(self, result: "Result", files: Sequence[Path]) -> int:
        """Show a result and the files that were written, or print its JSON; the exit code."""
        self.show_result(result, files)
        if not result.doubts:
            return OK
        print_error(f"Not to be trusted: {' '.join(result.doubts)}")
        return NOT_TRUSTED

    def show_result(self, result: "Result", files: Sequence[Path]) -> None:
        """Show a result and the files that were written, or print its JSON."""
        if not (self.json or self.quiet):
            self.show(result.rendered(), plain("Written: " + ", ".join(str(file) for file in files)))
        if self.json:
            # JSON is UTF-8 whatever the terminal speaks, byte for byte what is in the file.
            sys.stdout.flush()
            sys.stdout.buffer.write(result.json_bytes())
            sys.stdout.buffer.flush()

    @contextmanager
    def working(self) -> Iterator[Progress]:
        """A progress line on standard error for as long as the work takes."""
        console = Console(stderr=True, highlight=False)
        if self.quiet:
            yield Progress(None, None)
        elif console.is_terminal:
            with console.status(plain("starting")) as status:
                yield Progress(console, status)
        else:
            yield Progress(console, None)

    @contextmanager
    def drawing(self) -> Iterator[Progress]:
        """The same for work that ends in pictures: what draws them is loaded meanwhile."""
        with beside(_load_pictures), self.working() as progress:
            yield progress


def _load_pictures() -> None:
    import savgs_ident.report.theme  # noqa: F401


def print_error(message: str) -> None:
    """One line to standard error, whatever was asked for."""
    Console(stderr=True, highlight=False).print(_line(message), soft_wrap=True)


def ends_with_code(command: Callable[Arguments, int]) -> Callable[Arguments, None]:
    """The command, whose returned code becomes the exit code and whose expected errors become one line."""

    @wraps(command)
    def guarded(*args: Arguments.args, **kwargs: Arguments.kwargs) -> None:
        raise typer.Exit(_code_of(lambda: command(*args, **kwargs)))

    return guarded


def refused(error: OSError) -> int:
    """Say what the system refused, in one line; the exit code."""
    place = f"{error.filename}: " if error.filename else ""
    print_error(
        f"Error: {place}{error.strerror or error}. Remedy: check the path, its permissions, the disk."
    )
    return BAD_INPUT


def mend_streams() -> None:
    """Make standard output and standard error of this process take whatever is written to them."""
    sys.stdout = _mended(sys.stdout, 1, needed=True)
    sys.stderr = _mended(sys.stderr, 2, needed=False)


def _press(number: int, frame: FrameType | None) -> None:
    _PRESSED.set()
    signal.default_int_handler(number, frame)


@contextmanager
def _ctrl_c_is_kept() -> Iterator[None]:
    """Note Ctrl-C while a command runs, where Python raises it."""
    _PRESSED.clear()
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _press)
    before, sys.unraisablehook = sys.unraisablehook, _without_ctrl_c(sys.unraisablehook)
    try:
        yield
    finally:
        sys.unraisablehook = before
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _without_ctrl_c(
    hook: Callable[["UnraisableHookArgs"], object],
) -> Callable[["UnraisableHookArgs"], object]:
    """The hook for exceptions that could not be raised, but for Ctrl-C: the next line of progress raises that."""

    def report(found: "UnraisableHookArgs") -> None:
        if not issubclass(found.exc_type, KeyboardInterrupt):
            hook(found)

    return report


def _code_of(work: Callable[[], int]) -> int:
    try:
        with _ctrl_c_is_kept():
            return work()
    except KeyboardInterrupt:
        print_error("Stopped by Ctrl-C; files that were finished are kept.")
        return INTERRUPTED
    except InputError as error:
        print_error(f"Error: {error}")
        return BAD_INPUT
    except OSError as error:
        return refused(error)
    except Exception as error:
        from savgs_ident.plants.from_file import fault_of_a_plant

        fault = fault_of_a_plant(error)
        if fault is None:
            raise
        print_error(f"Error: {fault}")
        return BAD_INPUT


def _line(message: str) -> RenderableType:
    """``message`` in one line, whatever is in the names that it holds."""
    return plain(message.replace("\n", "\\n"))


class _Outlet(io.FileIO):
    """The bytes of a stream; after the first that it does not take, all others go nowhere."""

    def __init__(self, number: int, needed: bool) -> None:
        super().__init__(number, "wb", closefd=False)
        self._needed, self._deaf = needed, False

    def write(self, content: "ReadableBuffer") -> int:
        """Write, as far as anybody takes it."""
        if not self._deaf:
            try:
                return super().write(content)
            except OSError as error:
                self._deaf = True
                if self._needed and not isinstance(error, BrokenPipeError):
                    raise OSError(error.errno, error.strerror, "standard output") from error
        return memoryview(content).nbytes


def _mended(stream: TextIO | None, number: int, needed: bool) -> TextIO:
    if stream is None:  # Closed by whoever started the program.
        number, encoding = os.open(os.devnull, os.O_WRONLY), "utf-8"
    else:
        encoding = stream.encoding
        if stream.isatty() and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
            return stream
    outlet = io.BufferedWriter(_Outlet(number, needed))
    return io.TextIOWrapper(outlet, encoding, "backslashreplace", line_buffering=True)
