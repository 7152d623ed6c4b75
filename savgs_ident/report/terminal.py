"""Text for terminals from data that anybody may have named: nothing in it is markup, colour or control."""

from collections.abc import Iterable, Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text


def plain(text: object, style: str = "") -> Text:
    """``text`` as it is, with control characters spelled out and markup left unread.

    What keeps thousands apart becomes a space that every terminal knows.
    """
    shown = "".join(
        char if char.isprintable() or char == "\n" else char.encode("unicode_escape").decode()
        for char in str(text).replace("\u202f", " ")
    )
    return Text(shown, style=style)


def table(
    title: str, headers: Sequence[str], rows: Iterable[Sequence[object]], texts: Sequence[int] = (0,)
) -> RenderableType:
    """A table; the columns whose numbers are in ``texts`` hold texts and stand to the left."""
    grid = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
    for index, header in enumerate(headers):
        grid.add_column(plain(header), justify="left" if index in texts else "right", overflow="fold")
    for row in rows:
        grid.add_row(*(plain(cell) for cell in row))
    return Group(plain(title, "bold"), grid, plain(""))


def fixed(value: float | None, places: int) -> str:
    """A number of any unit with ``places`` decimals, a dash where there is none."""
    return "-" if value is None else f"{value:.{places}f}"


def figure_of(value: float | None, digits: int = 4) -> str:
    """A number of any unit with ``digits`` significant digits, a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"
