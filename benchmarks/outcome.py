"""What a benchmark gives: flat figures, and sentences about how they were obtained."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

Progress = Callable[[str], None]
"""Called with a sentence on what is being done."""


@dataclass(frozen=True)
class Outcome:
    """Figures by key (:data:`benchmarks.figures.FIGURES` says what each is), and notes for the reader."""

    figures: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __add__(self, other: "Outcome") -> "Outcome":
        return Outcome({**self.figures, **other.figures}, self.notes + other.notes)
