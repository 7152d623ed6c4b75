"""Figures on disk, as PNG to look at and as PDF to print."""

import io
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.figure import Figure

from savgs_ident.report.files import write_bytes
from savgs_ident.report.style import styled

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
