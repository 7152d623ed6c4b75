"""The signal that the port needs, against the motion it goes with: the shape of the loop tells what it is.

A friction is a box over displacement and a step over velocity, a stiffness a line over displacement, a damper one
over velocity, a hysteresis an ellipse. Over it stands the law of the named effect along the same motion.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from savgs_ident.diagnose.result import ForceLoop
from savgs_ident.report.diagnosis_words import port_words
from savgs_ident.report.numerals import unit_text
from savgs_ident.report.style import BLUE, INK, ORANGE, label_of, new_figure, styled

MOST_LOOPS = 6
"""So many loops are drawn at most."""

_MILLI = 1e3
_SMALL_UNITS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "N": ("N", 1.0)}
_ARROW_AT = 0.12
"""Where on the period the arrow is that says which way the loop is run through."""


def spread_loops(loops: tuple[ForceLoop, ...]) -> tuple[ForceLoop, ...]:
    """At most MOST_LOOPS of them, from the first test to the last."""
    if len(loops) <= MOST_LOOPS:
        return loops
    chosen = np.unique(np.linspace(0, len(loops) - 1, MOST_LOOPS).round().astype(int))
    return tuple(loops[place] for place in chosen)


def force_figure(loop: ForceLoop, law: str) -> Figure:
    """One loop over velocity (left) and displacement (right); ``law`` is what the legend calls its law."""
    unit, scale = _SMALL_UNITS.get(loop.unit, (loop.unit, 1.0))
    with styled():
        figure = new_figure(4.5, 3.0)
        figure.set_layout_engine("none")
        places = {"left": 0.15, "right": 0.97, "bottom": 0.165, "top": 0.79, "wspace": 0.1}
        left, right = figure.subplots(1, 2, sharey=True, gridspec_kw=places)
        figure.suptitle(
            label_of(f"{port_words(loop.port)} at {loop.frequency_hz:.3g} Hz"),
            y=0.985,
            fontsize=10.0,
            fontweight="bold",
        )
        for axes, motion in ((left, loop.velocity), (right, _from_middle(loop.displacement))):
            _draw(axes, _MILLI * motion, scale * loop.inferred, "inferred")
            if loop.law.size:
                _draw_law(axes, _MILLI * motion, scale * loop.law, law)
            axes.xaxis.set_major_locator(MaxNLocator(4))
        left.set_ylabel(label_of(f"{_quantity(loop.unit)} [{unit_text(unit)}]"))
        left.set_xlabel("velocity [mm/s]")
        right.set_xlabel("displacement [mm]")
        left.yaxis.set_label_coords(-0.24, 0.5)
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.55, 0.925), ncols=2)
        return figure


def _quantity(unit: str) -> str:
    """What a signal in this unit is."""
    return "force" if unit == "N" else "signal"


def _from_middle(displacement: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements count from the middle of their range: a strut is half a metre long."""
    return displacement - 0.5 * (np.max(displacement) + np.min(displacement))


def _draw(axes: Axes, across: NDArray[np.float64], up: NDArray[np.float64], label: str) -> None:
    axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.plot(np.append(across, across[:1]), np.append(up, up[:1]), color=BLUE, linewidth=1.5, label=label)
    if across.size > 16:
        at = int(_ARROW_AT * across.size)
        look = {"arrowstyle": "-|>", "color": BLUE, "mutation_scale": 13, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", (across[at + 2], up[at + 2]), (across[at], up[at]), arrowprops=look, zorder=4)


def _draw_law(axes: Axes, across: NDArray[np.float64], up: NDArray[np.float64], label: str) -> None:
    axes.plot(
        np.append(across, across[:1]),
        np.append(up, up[:1]),
        color=ORANGE,
        linestyle=(0, (5, 2)),
        linewidth=1.5,
        label=label_of(label),
    )
