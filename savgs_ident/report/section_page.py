"""A page made of sections: each a heading, a picture and a table, whatever they show.

A report on a model says in one sentence what was found, gives a few numbers at a glance, and then section after
section of evidence. What differs between such reports is data, so their page is written once:

    section_page(SectionPage("Linear models", "Linear models of gt_rear", "The suspension is ...", ..., sections))

Texts are texts: whatever they hold is escaped.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from savgs_ident.report.html import Picture, render_page


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
