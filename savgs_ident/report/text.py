"""Numbers, units and channels as people read them, and text for terminals.

A number has the digits that its error justifies, thousands in groups of three, and its unit:

>>> numeral(5386.23, 9.7), with_error(0.030018, 0.00012), interval(0.02941, 0.03059, 0.0003)
('5386.2', '0.03002 ± 0.00012', '0.02941 to 0.03059')
>>> unit_text("kg m^2")
'kg m²'

Very large and very small numbers have a power of ten, a pair of them one in common. Names come from data that anybody
may have written: in the terminal nothing in them is markup, colour or control.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import floor, isfinite, isinf, log10
from types import MappingProxyType
from typing import TYPE_CHECKING

from rich.console import Group, JustifyMethod, RenderableType
from rich.table import Table
from rich.text import Text

from savgs_ident.core.errors import DataWarning

if TYPE_CHECKING:
    from savgs_ident.plants.model import Model
    from savgs_ident.recordings.recording import RecordingLayout
    from savgs_ident.responses.harmonic_response import HarmonicResponse

MINUS = "\u2212"
"""A minus as long as a plus."""

DASH = "\u2013"
"""Stands where there is no number, or no unit."""

_NARROW_SPACE = "\u202f"
_TIMES = "\u00d7"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = (-4, 5)
"""Powers of ten of numbers that are written out."""


def numeral(value: float, error: float) -> str:
    """``value`` to the second significant digit of ``error``; to four digits of its own where that is unknown.

    Both are in the same unit.
    """
    return _scaled("{}", (value,), error)


def stacked(name: str, width: int = 14) -> str:
    """A long name in lines, broken behind its underscores, for the head of a narrow column.

    >>> stacked("guide_breakaway_force").split()
    ['guide_', 'breakaway_', 'force']
    """
    lines = [""]
    for part in name.replace("_", "_ ").split(" "):
        if lines[-1] and len(lines[-1]) + len(part) > width:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def with_error(value: float, error: float) -> str:
    """A value and its error in the same unit, both to the second significant digit of the error."""
    return _scaled("{} ± {}", (value, error), error)


def interval(low: float, high: float, error: float) -> str:
    """Two ends of an interval, to the second significant digit of ``error``. All are in the same unit."""
    return _scaled("{} to {}", (low, high), error)


def _scaled(form: str, values: tuple[float, ...], error: float) -> str:
    """``values`` in ``form``, with a power of ten in common where they are very large or very small."""
    known = [abs(value) for value in values if isfinite(value)]
    largest = max(known, default=0.0)
    # Powers of ten below the least normal number are zero.
    power = floor(log10(largest)) if largest > 1e-300 else 0
    last = floor(log10(error)) - 1 if isfinite(error) and error > 0.0 else power - 3
    if _PLAIN[0] <= power <= _PLAIN[1]:
        return form.format(*(_grouped(value, -last) for value in values))
    text = form.format(*(_grouped(value / 10.0**power, power - last) for value in values))
    whole = f"({text})" if len(values) > 1 else text
    return f"{whole} {_TIMES} 10{str(power).translate(_SUPERSCRIPTS)}"


def _grouped(value: float, places: int) -> str:
    """With so many decimals, and thousands apart from ten thousand on."""
    if not isfinite(value):
        return (f"{MINUS}∞" if value < 0.0 else "∞") if isinf(value) else "unknown"
    text = f"{value:,.{min(max(places, 0), 12)}f}"
    return text.replace(",", _NARROW_SPACE if abs(value) >= 1e4 else "").replace("-", MINUS)


def counted(number: int, noun: str) -> str:
    """A number of things, in words."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def tests_counted(measured: "HarmonicResponse") -> str:
    """How many dwells and windows there are, in words."""
    kinds = {"dwell": measured.dwells.size, "window": measured.windows.size}
    return " and ".join(counted(each, kind) for kind, each in kinds.items() if each)


def percentage(share: float, places: int = 1) -> str:
    """A share as a percentage, 100 only if it is the whole; a dash where there is none."""
    if not isfinite(share):
        return DASH
    if share < 1.0 and round(100.0 * share, places) == 100.0:
        return f"> {100.0 - 10.0**-places:.{places}f} %"
    return f"{100.0 * share:.{places}f} %".replace("-", MINUS)


def decimal(number: float, places: int) -> str:
    """A number of any unit with so many decimals; a dash where there is none."""
    return _grouped(number, places) if isfinite(number) else DASH


def count(number: float) -> str:
    """A whole number [1] in groups of three; a dash where there is none."""
    return _grouped(round(number), 0) if isfinite(number) else DASH


def signed(value: float, places: int) -> str:
    """A number of any unit with its sign, none if it rounds to zero; a dash where there is no number."""
    if not isfinite(value):
        return DASH
    rounded = round(value, places)
    return f"{rounded:+.{places}f}".replace("-", MINUS) if rounded else f"{0.0:.{places}f}"


def unit_text(unit: str) -> str:
    """A unit as it is printed, a dash for a number without one."""
    return DASH if unit == "1" else unit.replace("^2", "²").replace("^3", "³")


def plain(text: object, style: str = "") -> Text:
    """``text`` as it is, with control characters spelled out and markup left unread.

    What keeps thousands apart becomes a space that every terminal knows.
    """
    shown = "".join(
        char if char.isprintable() or char == "\n" else char.encode("unicode_escape").decode()
        for char in str(text).replace("\u202f", " ")
    )
    return Text(shown, style=style)


def data_warnings(warnings: Sequence[DataWarning]) -> list[Text]:
    """What the checks of the data found, with a heading: the first of each kind and channel, and how many more."""
    if not warnings:
        return []
    lines = first_of_each_kind([(each.code, each.channel, str(each)) for each in warnings])
    return [plain("Warnings about the data", "bold"), *(plain(f"- {line}") for line in lines)]


def first_of_each_kind(warnings: Iterable[tuple[str, str, str]]) -> list[str]:
    """Of warnings, each a code, a channel and a message, the first with its code and channel, and how many more."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for code, channel, message in warnings:
        kinds.setdefault((code, channel), []).append(message)
    return [
        f"{first} ({len(others)} more of this kind in this channel)" if others else first
        for first, *others in kinds.values()
    ]


LONGEST_NAME = 32
"""Longest text in the first column of a table that is never broken into lines."""


def table(
    title: str, headers: Sequence[str], rows: Iterable[Sequence[object]], texts: Sequence[int] = (0,)
) -> RenderableType:
    """A table; the columns whose numbers are in ``texts`` hold texts and stand to the left."""
    grid = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
    lines = [*rows]
    # A name is found again by searching for it: other columns make room for one of usual length.
    whole = 0 in texts and all(len(str(row[0])) <= LONGEST_NAME for row in lines)
    for index, header in enumerate(headers):
        justify: JustifyMethod = "left" if index in texts else "right"
        grid.add_column(plain(header), justify=justify, overflow="fold", no_wrap=whole and index == 0)
    for row in lines:
        grid.add_row(*(plain(cell) for cell in row))
    return Group(plain(title, "bold"), grid, plain(""))


def fixed(value: float | None, places: int) -> str:
    """A number of any unit with ``places`` decimals, a dash where there is none."""
    return "-" if value is None else f"{value:.{places}f}"


def significant(value: float | None, digits: int = 4) -> str:
    """A number of any unit with ``digits`` significant digits, a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"


@dataclass(frozen=True)
class ChannelLabel:
    """How a channel is shown.

    Attributes:
        title: its name in words.
        unit: in which its values are shown.
        scale: from SI to that unit.
        per_input: unit of its response to the input.
        input: that input in a word or two.
    """

    title: str
    unit: str
    scale: float
    per_input: str
    input: str = "road"

    @property
    def heading(self) -> str:
        """The title with a capital."""
        return f"{self.title[:1].upper()}{self.title[1:]}"


_UNIT_WORDS: Mapping[str, str] = MappingProxyType({"m": "metre", "rad": "radian", "N": "newton"})
_SHOWN_UNITS: Mapping[str, tuple[str, float]] = MappingProxyType({"m": ("mm", 1e3)})


def response_labels(layout: "RecordingLayout") -> dict[str, ChannelLabel]:
    """How the responses in the recordings of a plant are shown, by name in their order."""
    driven = layout.specs[layout.driven]
    named = [layout.specs[name] for name in layout.responses]
    return {each.name: _label(each.about, each.unit, driven.about, driven.unit) for each in named}


def shown_unit(unit: str) -> tuple[str, float]:
    """The unit in which values of an SI unit are printed, and the factor to it."""
    return _SHOWN_UNITS.get(unit, (unit_text(unit), 1.0))


def _label(about: str, unit: str, driven: str, driven_unit: str) -> ChannelLabel:
    shown, scale = shown_unit(unit)
    return ChannelLabel(about, shown, scale, f"{unit_text(unit)} per {unit_text(driven_unit)}", driven)


def channel_labels(model: "Model") -> dict[str, ChannelLabel]:
    """How the channels of a model's plant are shown, by name in their order, as responses to its first input."""
    driven = model.plant.inputs[0]
    return {each.name: _label(each.about, each.unit, driven.about, driven.unit) for each in model.channels}


def per_input_words(model: "Model") -> str:
    """What first harmonics are divided by, in words: "per metre of road"."""
    driven = model.plant.inputs[0]
    return f"per {_UNIT_WORDS.get(driven.unit, unit_text(driven.unit))} of {driven.about}"


def per_input_key(model: "Model") -> str:
    """The same as a key of JSON objects: "per_metre_of_road"."""
    driven = model.plant.inputs[0]
    return f"per_{_UNIT_WORDS.get(driven.unit, 'unit')}_of_{driven.about}".replace(" ", "_")


def channel_label(name: str, model: "Model") -> ChannelLabel:
    """How the channel ``name`` is shown: as the model's plant declares it; what is no channel, by its name."""
    return channel_labels(model).get(name) or ChannelLabel(name, DASH, 1.0, DASH)
