"""Where in the data a check is looking, so that whatever it finds says so."""

from dataclasses import dataclass

from savgs_ident.core.errors import DataWarning, InputError


@dataclass(frozen=True)
class Place:
    """A source, and the test and channel in it."""

    source: str
    test: str = ""
    channel: str = ""

    def error(self, what: str, remedy: str, time: float | None = None) -> InputError:
        """An error here, at ``time`` [s] if it has one."""
        return InputError(
            what, source=self.source, test=self.test, channel=self.channel, time=time, remedy=remedy
        )

    def warning(self, code: str, what: str, remedy: str, time: float | None = None) -> DataWarning:
        """A warning here, at ``time`` [s] if it has one."""
        return DataWarning(code, what, self.source, self.test, self.channel, time, remedy)
