"""Errors and warnings with the problem, its place, and a remedy.

An :class:`InputError` ends a command with exit code 2; a :class:`DataWarning` is stored with the data it concerns,
so that every report can show it.

    >>> remedy = "name it in channels.toml"
    >>> print(InputError("column 'position' is missing", source="run7.csv", remedy=remedy))
    run7.csv: column 'position' is missing. Remedy: name it in channels.toml.
"""

import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_LONGEST = {"name": 100, "what": 400, "remedy": 2000}
"""Characters of each part that a message shows: names and values come from arbitrary files."""


def one_line(text: str, most: int) -> str:
    """``text`` as one line of at most ``most`` characters: control characters escaped, the middle left out."""
    if len(text) > most:
        text = f"{text[: most - 40]} ... {text[-35:]}"
    if text.isprintable():
        return text
    return "".join(_escaped(char) if _is_control(char) else char for char in text)


def _is_control(char: str) -> bool:
    return unicodedata.category(char) in ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")


def _escaped(char: str) -> str:
    return char.encode("unicode_escape").decode()


def _compose(what: str, source: str, test: str, channel: str, time: float | None, remedy: str) -> str:
    what, remedy = one_line(what, _LONGEST["what"]), one_line(remedy, _LONGEST["remedy"])
    place = [one_line(source, len(source))]
    if test:
        place.append(f"test '{one_line(test, _LONGEST['name'])}'")
    if channel:
        place.append(f"channel '{one_line(channel, _LONGEST['name'])}'")
    if time is not None:
        place.append(f"at {time:.3f} s")
    head = ", ".join(part for part in place if part)
    text = f"{head}: {what}" if head else what
    return f"{text.rstrip('.')}. Remedy: {remedy.rstrip('.')}." if remedy else f"{text.rstrip('.')}."


class SavgsIdentError(Exception):
    """Base of all errors that this package raises on purpose."""


class InputError(SavgsIdentError):
    """Input that cannot be used: a file, a channel, an option (exit code 2).

    ``source`` is the file or option, ``test`` the test inside it, ``channel`` the channel or column,
    ``time`` the place in it [s], ``remedy`` what the user can do.
    """

    def __init__(
        self, what: str, *, source: object = "", test: str = "", channel: str = "", time: float | None = None,
        remedy: str = "",
    ) -> None:  # fmt: skip
        self.what, self.source, self.test, self.channel = what, str(source), test, channel
        self.time, self.remedy = time, remedy
        super().__init__(_compose(what, self.source, test, channel, time, remedy))

    def as_warning(self, code: str) -> "DataWarning":
        """The same as a warning, where the rest of the data can be used."""
        return DataWarning(code, self.what, self.source, self.test, self.channel, self.time, self.remedy)


@contextmanager
def blamed_on(source: object) -> Iterator[None]:
    """Add ``source`` to an :class:`InputError` raised within that names no file."""
    try:
        yield
    except InputError as error:
        if error.source:
            raise
        raise InputError(
            error.what,
            source=source,
            test=error.test,
            channel=error.channel,
            time=error.time,
            remedy=error.remedy,
        ) from None


@dataclass(frozen=True)
class DataWarning:
    """A finding about the data that the reader of a report should know, with a stable ``code``.

    ``code`` is a short name such as ``clipped_sensor``; the other fields are those of :class:`InputError`,
    ``time`` [s].
    """

    code: str
    what: str
    source: str = ""
    test: str = ""
    channel: str = ""
    time: float | None = None
    remedy: str = ""

    def __str__(self) -> str:
        return f"[{self.code}] " + _compose(
            self.what, self.source, self.test, self.channel, self.time, self.remedy
        )
