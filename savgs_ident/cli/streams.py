"""Standard output and standard error as they may be: closed, full, left by their reader, without Unicode.

No run ends, and no exit code changes, because nobody listens: what cannot be said is left unsaid. Only a full disk
under standard output is an error, for what is missing there is a part of the result.
"""

import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


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


def mend_streams() -> None:
    """Make standard output and standard error of this process take whatever is written to them."""
    sys.stdout = _mended(sys.stdout, 1, needed=True)
    sys.stderr = _mended(sys.stderr, 2, needed=False)


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
