"""The regimes of a diagnosis as one picture: a bar for each, as long as the gap there.

A regime in which the misfit is concentrated is coloured and has its p-value beside its bar, so that it is found in
grey too. The most significant regime is on top.
"""

from textwrap import wrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.report.diagnosis.text import LEVEL, motion_words, p_value_words, regimes_sentence
from savgs_ident.report.html import Picture, embed
from savgs_ident.report.theme import GREY, ORANGE, PALE, new_figure, printable, styled

_LETTERS = 24
"""In a line of a name."""

_LINE, _SPACE, _EDGES = 0.155, 0.13, 0.56
"""Height of a line of a name, between two bars, and of the axis [inch]."""

_ROOM = 1.32
"""The axis is so many times as long as the longest bar, for the p-value beside it."""


def regime_figure(diagnosis: Diagnosis) -> Figure:
    """The gap [% of the response] in each regime; the diagnosis must have some."""
    names = [_broken(printable(each.name)) for each in diagnosis.regimes]
    lines = sum(name.count("\n") + 1 for name in names)
    with styled():
        height = _EDGES + _LINE * lines + _SPACE * len(names)
        figure = new_figure(4.6, height)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.385, 0.46 / height, 0.59, 1.0 - _EDGES / height))
        at, above = [], 0.0
        for name in names:
            size = _LINE * (name.count("\n") + 1) + _SPACE
            at.append(above + 0.5 * size)
            above += size
        _draw_bars(axes, diagnosis, at)
        axes.set_yticks(at, names)
        axes.set_ylim(above, 0.0)
        axes.tick_params(axis="y", length=0.0)
        axes.grid(visible=False, axis="y")
        axes.set_axisbelow(True)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.set_xlabel("gap there [% of the response]")
        return figure


def _broken(name: str) -> str:
    """A name in lines, each of which is one of those that are joined by "or"."""
    parts = name.replace(" or ", " or\n").split("\n")
    return "\n".join(line for part in parts for line in wrap(part, _LETTERS))


def _draw_bars(axes: Axes, diagnosis: Diagnosis, at: list[float]) -> None:
    longest = max((each.gap_percent for each in diagnosis.regimes), default=0.0) or 1.0
    for place, each in zip(at, diagnosis.regimes, strict=True):
        significant = each.p_value < LEVEL
        look = {"color": ORANGE} if significant else {"color": PALE, "edgecolor": GREY, "linewidth": 0.5}
        axes.barh(place, each.gap_percent, height=1.3 * _LINE, **look)
        if significant:
            beside = each.gap_percent + 0.02 * longest
            axes.text(beside, place, f"p = {p_value_words(each.p_value)}", va="center", fontsize=8.5)
    axes.set_xlim(0.0, _ROOM * longest)


def regime_picture(diagnosis: Diagnosis) -> Picture | None:
    """The picture for the page with its words; None where no regime was looked at."""
    if not diagnosis.regimes:
        return None
    found = regimes_sentence(diagnosis) or "The recalibrated gap is concentrated in no regime."
    return embed(regime_figure(diagnosis), f"Gap by regime. {found}")


def regime_note(diagnosis: Diagnosis) -> str:
    """What the regimes are, for the page."""
    port = motion_words(diagnosis)
    where = f" of the {port}" if port else ""
    return (
        f"Gap of the recalibrated model beyond the noise. Speed, stroke and direction are those{where}; low and high"
        " are thirds of the instants of each test, slow and fast thirds of the tests; the gap of a drift is what a"
        " linear trend over time changes. Coloured, with its p-value: the misfit is more concentrated there than the"
        " errors of a good model would be"
        f" (below {100.0 * LEVEL:.0f} %, corrected for all regimes by Holm's method)."
    )
