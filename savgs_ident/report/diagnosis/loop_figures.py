"""Figures of the signal inferred at a port: loops over velocity and displacement, beside the law that is named.

A friction is a box over displacement and a step over velocity, a stiffness a line over displacement, a damper one
over velocity, a hysteresis an ellipse. The law that is named stands beside it, along the same motion with its 95 %
band, and beside a learned law the formula of the catalogue that comes nearest.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from savgs_ident.diagnosis.candidates import WITHIN
from savgs_ident.diagnosis.result import Diagnosis, DriveForces, ForceLoop
from savgs_ident.report.diagnosis.text import law_label, port_words
from savgs_ident.report.text import unit_text
from savgs_ident.report.theme import BLUE, INK, ORANGE, new_figure, printable, styled

MOST_LOOPS = 6
"""So many loops are drawn at most."""

_SMALL_UNITS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "N": ("N", 1.0)}
_NAMED: Mapping[str, Any] = {"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.5}
_NEAREST: Mapping[str, Any] = {"color": INK, "linestyle": ":", "linewidth": 1.2}
_ARROW_AT = 0.12
"""Where on the period the arrow is that says which way the loop is run through."""


def spread_loops(loops: tuple[ForceLoop, ...]) -> tuple[ForceLoop, ...]:
    """At most MOST_LOOPS of them, from the first test to the last."""
    if len(loops) <= MOST_LOOPS:
        return loops
    chosen = np.unique(np.linspace(0, len(loops) - 1, MOST_LOOPS).round().astype(int))
    return tuple(loops[place] for place in chosen)


def loop_time(diagnosis: Diagnosis, loop: ForceLoop) -> str:
    """Of which test a loop is, or of how much of a motion that was followed from its beginning."""
    if not loop.inferred.size:
        return f"over {1.0 / loop.frequency_hz:.3g} s of a window"
    if isinstance(diagnosis.responses, DriveForces):
        return f"over the first {1.0 / loop.frequency_hz:.3g} s"
    return f"at {loop.frequency_hz:.3g} Hz"


def force_figure(diagnosis: Diagnosis, loop: ForceLoop) -> Figure:
    """One loop over velocity (left) and displacement (right), beside the law of the named effects.

    The law with its 95 % band; beside a learned one the formula of the catalogue that comes nearest.
    """
    unit, scale = _unit_for(
        loop.unit, next(each for each in (loop.inferred, loop.law, loop.nearest) if each.size)
    )
    motion_unit, factor = _unit_for(loop.motion_unit, loop.displacement)
    closed = bool(loop.inferred.size)
    with styled():
        figure = new_figure(4.5, 3.0)
        figure.set_layout_engine("none")
        top = 0.73 if loop.nearest.size else 0.79
        places = {"left": 0.15, "right": 0.97, "bottom": 0.165, "top": top, "wspace": 0.1}
        left, right = figure.subplots(1, 2, sharey=True, gridspec_kw=places)
        figure.suptitle(
            printable(f"{port_words(diagnosis, loop.port)} {loop_time(diagnosis, loop)}"),
            y=0.985,
            fontsize=10.0,
            fontweight="bold",
        )
        for axes, motion in ((left, loop.velocity), (right, _from_middle(loop.displacement))):
            axes.axhline(0.0, color=INK, linewidth=0.6)
            if loop.inferred.size:
                _draw_inferred(axes, factor * motion, scale * loop.inferred)
            if loop.law.size:
                _draw_band(axes, factor * motion, scale * loop.law, scale * WITHIN * loop.law_sd)
                name = law_label(diagnosis, loop.port)
                _draw_curve(axes, factor * motion, scale * loop.law, name, closed=closed, **_NAMED)
            if loop.nearest.size:
                nearest = f"nearest: {diagnosis.verdict.effects[0]}"
                _draw_curve(axes, factor * motion, scale * loop.nearest, nearest, closed=closed, **_NEAREST)
            axes.xaxis.set_major_locator(MaxNLocator(4))
        left.set_ylabel(printable(f"{_quantity(loop.unit)} [{unit_text(unit)}]"))
        left.set_xlabel(f"velocity [{motion_unit}/s]")
        right.set_xlabel(f"displacement [{motion_unit}]")
        left.yaxis.set_label_coords(-0.24, 0.5)
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.55, 0.925), ncols=2)
        return figure


def _unit_for(unit: str, values: NDArray[np.float64]) -> tuple[str, float]:
    """The unit in which such values are drawn, and how many of it are one of theirs: smaller ones below one."""
    small = np.ptp(values) < 1.0
    return _SMALL_UNITS.get(unit, (unit, 1.0)) if small else (unit, 1.0)


def _quantity(unit: str) -> str:
    """What a signal in this unit is."""
    return "force" if unit == "N" else "signal"


def _from_middle(displacement: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements count from the middle of their range: a strut is half a metre long."""
    return displacement - 0.5 * (np.max(displacement) + np.min(displacement))


def _draw_inferred(axes: Axes, across: NDArray[np.float64], up: NDArray[np.float64]) -> None:
    axes.plot(
        np.append(across, across[:1]), np.append(up, up[:1]), color=BLUE, linewidth=1.5, label="inferred"
    )
    if across.size > 16:
        at = int(_ARROW_AT * across.size)
        look = {"arrowstyle": "-|>", "color": BLUE, "mutation_scale": 13, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", (across[at + 2], up[at + 2]), (across[at], up[at]), arrowprops=look, zorder=4)


def _draw_band(
    axes: Axes, across: NDArray[np.float64], up: NDArray[np.float64], half: NDArray[np.float64]
) -> None:
    """The band about a closed loop, so wide to either side; none where its width is not known."""
    if not half.size:
        return
    x, low, high = (np.append(each, each[:1]) for each in (across, up - half, up + half))
    corners = [np.column_stack([x, each]) for each in (low, high)]
    pieces = np.stack([corners[0][:-1], corners[0][1:], corners[1][1:], corners[1][:-1]], axis=1)
    axes.add_collection(PolyCollection(list(pieces), facecolor=(ORANGE, 0.25), linewidth=0.0, zorder=1))


def _draw_curve(
    axes: Axes, across: NDArray[np.float64], up: NDArray[np.float64], label: str, closed: bool, **look: Any
) -> None:
    """A curve beside the signal that is inferred; closed but for a part of a window."""
    ends = (np.append(each, each[:1]) if closed else each for each in (across, up))
    axes.plot(*ends, label=printable(label), **look)
