"""Pages that are one file each: nothing is fetched, nothing is executed, every text from outside is escaped.

A page is a Jinja2 template of the folder ``templates`` that extends ``page.html.j2``; figures are embedded as
SVG, which stays sharp on a screen and on paper. Three locks stand between a hostile name in the data and the
reader: escaping in the template, images that cannot execute anything, and a content security policy in the page
that forbids scripts and every request.
"""

import base64
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from savgs_ident.report.style import styled

_RASTER_DPI = 160
_CSS_PIXELS_PER_INCH = 96
_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)


@dataclass(frozen=True)
class Picture:
    """A figure ready for a page: ``source`` is its data URI, ``alt`` says in words what it shows.

    ``width`` and ``height`` are its natural size [CSS pixel]; pages shrink it to the room there is.
    """

    source: str
    alt: str
    width: int
    height: int


def embed(figure: Figure, alt: str) -> Picture:
    """``figure`` as a picture; the same figure gives the same bytes.

    This is the last thing to do with a figure: its layout is settled and its canvas is the printed one.
    """
    svg = io.BytesIO()
    # Names of clip paths are hashes with a salt, by default another one each time. Text as outlines looks the
    # same wherever it is opened.
    with styled(), matplotlib.rc_context({"svg.hashsalt": "savgs-ident", "svg.fonttype": "path"}):
        figure.dpi = _RASTER_DPI
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine("none")
        FigureCanvasSVG(figure).print_svg(svg, metadata={"Date": None, "Creator": None})
    width, height = figure.get_size_inches() * _CSS_PIXELS_PER_INCH
    encoded = base64.b64encode(svg.getvalue()).decode("ascii")
    return Picture(f"data:image/svg+xml;base64,{encoded}", alt, round(width), round(height))


def render_page(template: str, values: Mapping[str, object]) -> str:
    """The page that ``template`` makes of ``values``; a value that it asks for and does not get is an error.

    Characters that HTML does not have, and those that turn the direction of reading, are spelled out.
    """
    page = _environment().get_template(template).render(values)
    return _UNPRINTABLE.sub(lambda found: found.group().encode("unicode_escape").decode(), page)


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("savgs_ident.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
