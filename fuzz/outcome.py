"""What became of one damaged file."""

from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """How it ended."""

    read = "read"
    refused = "refused"
    failed = "failed"


@dataclass(frozen=True)
class Outcome:
    """One input of one loader.

    Attributes:
        loader: its name.
        number: of the input; with the seed it gives the same input again.
        kind: how it ended.
        how: what was done to the good file.
        reason: the message of a refusal, or why it counts as failed.
        trace: where it failed; empty otherwise.
    """

    loader: str
    number: int
    kind: Kind
    how: str = ""
    reason: str = ""
    trace: str = ""
