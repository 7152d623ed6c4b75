"""The force of a drive along a measured motion, drawn: measured, as models need it, and what they leave."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from savgs_ident.report.bode import LINES
from savgs_ident.report.theme import GREY, INK, PALE, new_figure, styled

SHOWN_S = 7.0
"""Longest stretch of the motion that is drawn [s]: about a cycle of a slow axis."""


def drive_figure(
    time: NDArray[np.float64],
    velocity: NDArray[np.float64],
    measured: NDArray[np.float64],
    models: Sequence[tuple[str, NDArray[np.float64]]],
    noise: float,
    units: tuple[str, str],
    band: str = "measurement noise",
) -> Figure:
    """Velocity, force, and force less that which each of the ``models`` needs, over ``time`` [s]; (m,) each.

    The models are labels with their force, the best first. ``noise`` is half the width of the band about zero, which
    is called ``band``; ``units`` are those of force and velocity.
    """
    shown = time <= time[0] + SHOWN_S
    # Lines are broken where rows are left out.
    gaps = np.flatnonzero(np.diff(time[shown]) > 1.5 * np.median(np.diff(time))) + 1

    def drawn(axes: Axes, values: NDArray[np.float64], **line: Any) -> None:
        axes.plot(*(np.insert(each[shown], gaps, np.nan) for each in (time, values)), **line)

    with styled():
        figure = new_figure(9.2, 5.6)
        above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(0.5, 1.0, 1.0))
        drawn(above, velocity, color=GREY, lw=1.2)
        above.set_ylabel(f"velocity [{units[1]}]")
        drawn(middle, measured, color=INK, lw=3.2, alpha=0.35, label="measured")
        below.axhspan(-noise, noise, color=PALE, lw=0.0, zorder=0.5)
        for (label, force), line in zip(models, LINES, strict=False):
            drawn(middle, force, label=label, **line)
            drawn(below, measured - force, **line)
        middle.set_ylabel(f"force of the drive [{units[0]}]")
        below.set_ylabel(f"measured less\nneeded [{units[0]}]")
        whole = float(time[-1] - time[0])
        part = f", the first {SHOWN_S:g} of {whole:.3g} s" if whole > SHOWN_S else ""
        below.set_xlabel(f"time since the first sample [s]{part}")
        _explain_lines(figure, middle, band)
        figure.align_ylabels()
        return figure


def _explain_lines(figure: Figure, axes: Axes, band: str) -> None:
    lines, _ = axes.get_legend_handles_labels()
    noise = Patch(color=PALE, label=band)
    figure.legend(handles=[*lines, noise], loc="outside upper center", ncols=5, columnspacing=1.2)
