"""The table of figures, for people."""

from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Console, Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from benchmarks.figures import FIGURES


def make_table(
    figures: Mapping[str, float], notes: Sequence[str], machine: Mapping[str, object]
) -> RenderableType:
    """All figures that were measured, in the order of :data:`FIGURES`, with what they mean."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("figure", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("meaning")
    for key, figure in FIGURES.items():
        if key in figures:
            table.add_row(key, format(figures[key], figure.shown), figure.unit, escape(figure.meaning))
    where = ", ".join(f"{key.removeprefix('machine_')} {value}" for key, value in machine.items())
    return Group(table, *(Text(f"- {note}") for note in notes), Text(f"Machine: {where}"))


def print_table(content: RenderableType) -> None:
    """Print on standard output, wide enough for the sentences where nobody says how wide it is."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=150)
    console.print(content)
