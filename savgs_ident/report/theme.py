"""The style of all figures, and figures on disk as PNG and PDF.

Figures are readable in grey and to colour-blind eyes: lines and markers differ by shape. They are made without
pyplot, so that nothing global changes; text that comes from data goes through :func:`printable`, which leaves no
character that the font lacks and none that would be read as a formula.
"""

import io
from contextlib import AbstractContextManager
from math import ceil, floor, log10
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from savgs_ident.core.files import write_bytes

INK = "#1a1a1a"
GREY = "#8a8a8a"
PALE = "#dedede"
BLUE = "#0b5ea8"
ORANGE = "#d95f02"

_TICKS = (0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0)
"""Round numbers for a quarter car's frequencies [Hz]."""

_IN_A_DECADE = (
    (4.0, (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)),
    (30.0, (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)),
)
"""Round numbers in a decade for others, where the highest is less than so many times the lowest."""


def styled() -> AbstractContextManager[None]:
    """The context in which figures are made and drawn."""
    return matplotlib.rc_context(
        {
            "font.family": "DejaVu Sans",
            "font.size": 9.0,
            "axes.titlesize": 10.0,
            "axes.titleweight": "bold",
            "axes.labelsize": 9.0,
            "axes.edgecolor": INK,
            "axes.linewidth": 0.8,
            "axes.grid": True,
            "axes.axisbelow": True,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "grid.color": PALE,
            "grid.linewidth": 0.6,
            "legend.frameon": False,
            "legend.fontsize": 8.5,
            "lines.linewidth": 1.6,
            "text.parse_math": False,
            "pdf.fonttype": 3,
        }
    )


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of this size [in, 25.4 mm] that lays its parts out by itself."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def frequency_axis(axes: Axes, lowest: float, highest: float, labelled: bool = True) -> None:
    """A logarithmic frequency axis from ``lowest`` to ``highest`` [Hz] with round numbers on it."""
    axes.set_xscale("log")
    low, high = lowest / 1.06, highest * 1.06
    axes.set_xlim(low, high)
    ticks = [tick for tick in _offered_ticks(low, high) if low <= tick <= high]
    # Tests that lie close together, or one alone, may have no round number among them.
    axes.xaxis.set_major_locator(FixedLocator(ticks if len(ticks) > 1 else [lowest, highest]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    axes.tick_params(axis="x", labelbottom=labelled)
    if labelled:
        axes.set_xlabel("frequency [Hz]")


def _offered_ticks(low: float, high: float) -> tuple[float, ...]:
    """Round numbers [Hz] for an axis between two."""
    if high < min(30.0 * low, 25.0) and low > 0.09:
        return _TICKS
    shares = next((each for span, each in _IN_A_DECADE if high < span * low), (1.0, 2.0, 5.0))
    decades = range(floor(log10(low)), ceil(log10(high)) + 1)
    return tuple(float(f"{share * 10.0**decade:.6g}") for decade in decades for share in shares)


def magnitude_axis(axes: Axes) -> None:
    """A logarithmic axis for magnitudes with numbers at 1, 2 and 5 of every decade, written out."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_minor_locator(LogLocator(10.0, subs=tuple(range(1, 10))))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def printable(text: object) -> str:
    """``text`` with every character that the font cannot draw spelled out."""
    font = get_font(findfont(FontProperties(family="DejaVu Sans")))
    known = font.get_charmap()
    return "".join(
        char if char.isprintable() and ord(char) in known else char.encode("unicode_escape").decode()
        for char in str(text)
    )


DPI = 160
"""Resolution of PNG files [1/inch]."""


def write_figure(folder: Path, stem: str, figure: Figure) -> tuple[Path, Path]:
    """Write ``figure`` as ``stem``.png and ``stem``.pdf; the same figure gives the same bytes.

    This is the last thing to do with a figure: its layout is settled and its canvas is the printed one.

    Raises :class:`InputError` if a file cannot be written.
    """
    png, pdf = io.BytesIO(), io.BytesIO()
    with styled():
        # Laid out once and drawn once a file; saving by the figure itself would do both over again each time.
        figure.dpi = DPI
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine("none")
        FigureCanvasAgg(figure).print_png(png)
        FigureCanvasPdf(figure).print_pdf(pdf, metadata={"CreationDate": None})
    return (
        write_bytes(folder / f"{stem}.png", png.getvalue()),
        write_bytes(folder / f"{stem}.pdf", pdf.getvalue()),
    )
