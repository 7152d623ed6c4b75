"""Pages that are one file each: nothing is fetched, nothing is executed, every text from outside is escaped.

A page is a Jinja2 template of the folder ``templates`` that extends ``page.html.j2``; figures are embedded as
SVG, which stays sharp on a screen and on paper. Three locks stand between a hostile name in the data and the
reader: escaping in the template, images that cannot execute anything, and a content security policy in the page
that forbids scripts and every request.

Most reports have the same shape: a sentence, a few numbers, and sections with a heading, a picture and a table. Their
page is written once, and what differs between them is data:

    section_page(SectionPage("Linear models", "Linear models of gt_rear", "The suspension is ...", ..., sections))
"""

import base64
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from savgs_ident.report.theme import styled

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
    environment = Environment(
        loader=PackageLoader("savgs_ident.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["prose"] = prose
    return environment


def prose(text: str) -> Markup:
    """A sentence for a page: escaped, names in backticks in code font, a number and its per cent on one line."""
    escaped = str(escape(text)).replace(" %", "\u00a0%")
    return Markup(re.sub("`([^`]*)`", r"<code>\1</code>", escaped))


@dataclass(frozen=True)
class Fact:
    """A number at a glance: its ``name``, its ``value`` with unit, ``then`` what to hold it against.

    ``bad`` marks one that is not as it should be.
    """

    name: str
    value: str
    then: str = ""
    bad: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of cells below ``headers``, the first cell of each its heading.

    ``numeric_columns`` are the places, from 0, of those that hold numbers.
    """

    caption: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric_columns: tuple[int, ...]


@dataclass(frozen=True)
class Section:
    """One piece of evidence.

    Attributes:
        name: its address on the page, letters and hyphens.
        heading: what it is about.
        note: a paragraph below the heading.
        picture: what there is to see.
        caption: what to see in it.
        wide: whether the picture is too large for a phone and scrolls there in its own box.
        table: the numbers.
    """

    name: str
    heading: str
    note: str = ""
    picture: Picture | None = None
    caption: str = ""
    wide: bool = False
    table: Table | None = None


@dataclass(frozen=True)
class SectionPage:
    """A report.

    Attributes:
        kind: what sort of report it is, above the sentence.
        title: of the window.
        sentence: what was found.
        intro: a paragraph on what was done; empty for none.
        alarm: why the numbers are not to be trusted; empty if they are.
        facts: the numbers at a glance.
        sections: the evidence, in the order to be read.
        settings: what it was made from and with, by name.
        command: the command line.
        versions: of the packages, by name.
    """

    kind: str
    title: str
    sentence: str
    intro: str
    alarm: str
    facts: tuple[Fact, ...]
    sections: tuple[Section, ...]
    settings: Mapping[str, str]
    command: str
    versions: Mapping[str, str]


def section_page(page: SectionPage) -> str:
    """The page: one file, no network, nothing executed; the same record gives the same bytes."""
    return render_page("sections.html.j2", {"page": page})
