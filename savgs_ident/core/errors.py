"""Errors and warnings that say what is wrong, where, and what to do about it.

An :class:`InputError` ends a command with exit code 2; a :class:`DataWarning` travels along with the
data it concerns, so that every report can show it.

    >>> remedy = "name it in channels.toml"
    >>> print(InputError("column 'sprung_accel' is missing", source="run7.csv", remedy=remedy))
    run7.csv: column 'sprung_accel' is missing. Remedy: name it in channels.toml.
"""

from dataclasses import dataclass


def _compose(what: str, source: str, test: str, channel: str, time: float | None, remedy: str) -> str:
    place = [source]
    if test:
        place.append(f"test '{test}'")
    if channel:
        place.append(f"channel '{channel}'")
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


@dataclass(frozen=True)
class DataWarning:
    """Something in the data that a careful reader would want to know, with a stable ``code``.

    ``code`` is a short name such as ``clipped_sensor``; the other fields are those of :class:`InputError`.
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
