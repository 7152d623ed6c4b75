"""Any plant as a block with its ports: the share of the gap that a law at each explains, the named port in orange.

What drives the plant is on the left, its equations are the block in the middle, what its sensors read is on the
right. Ports of forces, of what gives way in series, and of numbers are inside the block. A bar under each name is the
share of the recalibrated gap in held-out tests that a law learned there explains.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from textwrap import wrap
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Rectangle

from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.effects.base import PortKind
from savgs_ident.report.diagnosis.text import port_words
from savgs_ident.report.text import DASH, percentage
from savgs_ident.report.theme import BLUE, GREY, INK, ORANGE, PALE, new_figure, printable, styled

Side = Literal["input", "inside", "sensor"]

WIDTH = 5.17
"""Of the figure [inch]."""

_ROW, _TOP, _BOTTOM = 0.66, 0.5, 0.28
_COLUMNS: Mapping[Side, float] = {"input": 0.1, "inside": 2.0, "sensor": 4.02}
"""Where the names of a column begin [inch]."""

_BLOCK = (1.82, 3.42)
"""Left and right side of the block [inch]."""

_BAR, _THICK = 0.6, 0.078
_LETTERS: Mapping[Side, int] = {"input": 17, "inside": 22, "sensor": 16}
"""So many letters of a name fit into a line."""


@dataclass(frozen=True)
class BlockPort:
    """A port in the diagram: its name in words, on which side it is, its share, and whether the verdict names it."""

    words: str
    side: Side
    share: float
    named: bool


def block_ports(diagnosis: Diagnosis) -> tuple[BlockPort, ...]:
    """Every location of the plant once, in the order in which the plant declares them."""
    shares = {each.port: each.share for each in diagnosis.ports}
    kinds: dict[str, list[PortKind]] = {}
    for port in diagnosis.given.plant.ports:
        kinds.setdefault(port.location, []).append(port.kind)
    for other in (*shares, *diagnosis.verdict.ports):
        kinds.setdefault(other, [])
    return tuple(
        BlockPort(
            # What stands on the right are sensors: there is no room to say so before each name.
            port_words(diagnosis, location).removeprefix("sensor."),
            _side(kind),
            shares.get(location, float("nan")),
            location in diagnosis.verdict.ports,
        )
        for location, kind in kinds.items()
    )


def _side(kinds: Sequence[PortKind]) -> Side:
    if PortKind.INPUT in kinds:
        return "input"
    return "sensor" if PortKind.SENSOR in kinds else "inside"


def block_figure(diagnosis: Diagnosis) -> Figure:
    """The plant as a block, its ports and their shares."""
    ports = block_ports(diagnosis)
    columns = {side: [each for each in ports if each.side == side] for side in _COLUMNS}
    rows = max(1, *(len(each) for each in columns.values()))
    height = _BOTTOM + rows * _ROW + _TOP
    with styled():
        figure = new_figure(WIDTH, height)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0.0, WIDTH)
        axes.set_ylim(0.0, height)
        left, right = _BLOCK
        axes.add_patch(
            FancyBboxPatch(
                (left, 0.12), right - left, height - 0.24, boxstyle="round,pad=0,rounding_size=0.08",
                facecolor="#f3f6f9", edgecolor=INK, lw=1.1,
            )
        )  # fmt: skip
        name = printable(diagnosis.given.plant_name)
        axes.text(0.5 * (left + right), height - 0.34, name, ha="center", fontweight="bold", color=INK)
        for side, listed in columns.items():
            for number, port in enumerate(listed):
                at = height - _TOP - (number + (rows - len(listed)) / 2.0 + 0.5) * _ROW
                _draw_port(axes, port, _COLUMNS[side], at)
        return figure


def _draw_port(axes: Axes, port: BlockPort, x: float, y: float) -> None:
    """Name above, bar and share at its height, and the way into the block or out of it."""
    colour, weight = (ORANGE, "bold") if port.named else (BLUE, "normal")
    lines = wrap(port.words, _LETTERS[port.side], max_lines=2, placeholder=" \u2026")
    axes.text(
        x, y + 0.085, printable("\n".join(lines)), fontsize=8.5, fontweight=weight, color=INK, linespacing=1.0
    )
    bottom, known = y - 0.5 * _THICK, isfinite(port.share)
    axes.add_patch(Rectangle((x, bottom), _BAR, _THICK, facecolor=PALE, edgecolor="none"))
    if known:
        filled = _BAR * min(max(port.share, 0.0), 1.0)
        axes.add_patch(Rectangle((x, bottom), filled, _THICK, facecolor=colour, edgecolor="none"))
    share = percentage(port.share, 0) if known else DASH
    axes.text(x + _BAR + 0.07, y, share, fontsize=8.5, fontweight=weight, va="center", color=INK)
    ends = {"input": (x + 1.15, _BLOCK[0]), "sensor": (_BLOCK[1], x - 0.08)}.get(port.side)
    if ends is not None:
        axes.add_patch(
            FancyArrowPatch(
                (ends[0], y), (ends[1], y), arrowstyle="-|>", mutation_scale=9.0, shrinkA=0.0, shrinkB=0.0,
                color=ORANGE if port.named else GREY, lw=1.6 if port.named else 1.0,
            )
        )  # fmt: skip
