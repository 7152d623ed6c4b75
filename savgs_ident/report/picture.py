"""Figures on disk, as PNG to look at and as PDF to print."""

import io
from pathlib import Path

from matplotlib.figure import Figure

from savgs_ident.report.files import write_bytes
from savgs_ident.report.style import styled

DPI = 160
"""Resolution of PNG files [1/inch]."""


def write_figure(folder: Path, stem: str, figure: Figure) -> tuple[Path, Path]:
    """Write ``figure`` as ``stem``.png and ``stem``.pdf; the same figure gives the same bytes.

    Raises :class:`InputError` if a file cannot be written.
    """
    png, pdf = io.BytesIO(), io.BytesIO()
    with styled():
        # Laid out once: the layout of a large figure takes longer than its drawing.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        figure.savefig(png, format="png", dpi=DPI)
        figure.savefig(pdf, format="pdf", metadata={"CreationDate": None})
    return (
        write_bytes(folder / f"{stem}.png", png.getvalue()),
        write_bytes(folder / f"{stem}.pdf", pdf.getvalue()),
    )
