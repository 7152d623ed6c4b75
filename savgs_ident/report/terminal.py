"""Text for terminals from data that anybody may have named: nothing in it is markup, colour or control."""

from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text


def plain(text: object, style: str = "") -> Text:
    """``text`` exactly as it is, with control characters spelled out and markup left unread."""
    shown = "".join(
        char if char.isprintable() or char == "\n" else char.encode("unicode_escape").decode()
        for char in str(text)
    )
    return Text(shown, style=style)


def table(
    title: str, headers: Sequence[str], rows: Iterable[Sequence[object]], left: int = 1
) -> RenderableType:
    """A table whose first ``left`` columns are texts and the others numbers."""
    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for index, header in enumerate(headers):
        grid.add_column(plain(header), justify="left" if index < left else "right", overflow="fold")
    for row in rows:
        grid.add_row(*(plain(cell) for cell in row))
    return Group(plain(title, "bold"), grid)


def figure_of(value: float | None, digits: int = 4) -> str:
    """A number with ``digits`` significant digits, a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"
