"""The force of a drive along a measured motion: measured, and what three models need.

Above the force over one cycle of the motion, below what each model leaves of it: a friction that is missing steps
where the velocity changes its sign, an inertia where the carriage accelerates. The noise is a band about zero.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from savgs_ident.diagnosis.result import Diagnosis, DriveForces
from savgs_ident.report.diagnosis.text import model_label
from savgs_ident.report.panels import LINES
from savgs_ident.report.theme import GREY, INK, PALE, new_figure, styled

SHOWN_S = 7.0
"""Longest stretch of the motion that is drawn [s]: about a cycle of a slow axis."""


def drive_figure(diagnosis: Diagnosis) -> Figure:
    """The force of the drive and what is left of it; the diagnosis must be one along a motion."""
    forces = diagnosis.responses
    assert isinstance(forces, DriveForces)
    shown = forces.time <= forces.time[0] + SHOWN_S
    time = forces.time[shown]
    with styled():
        figure = new_figure(9.2, 5.6)
        above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(0.5, 1.0, 1.0))
        above.plot(time, forces.velocity[shown], color=GREY, lw=1.2)
        above.set_ylabel("velocity [m/s]")
        middle.plot(time, forces.measured[shown], color=INK, lw=3.2, alpha=0.35, label="measured")
        noise = diagnosis.shrink.floor * float(np.sqrt(np.mean(forces.measured**2)))
        below.axhspan(-noise, noise, color=PALE, lw=0.0, zorder=0.5)
        models = (
            (model_label(diagnosis), forces.after),
            ("recalibrated", forces.recalibrated),
            ("before, as given", forces.before),
        )
        for (label, force), line in zip(models, LINES, strict=True):
            middle.plot(time, force[shown], label=label, **line)
            below.plot(time, (forces.measured - force)[shown], **line)
        middle.set_ylabel("force of the drive [N]")
        below.set_ylabel("measured less\nneeded [N]")
        below.set_xlabel("time since the first sample [s]")
        _explain(figure, middle)
        figure.align_ylabels()
        return figure


def drive_words(diagnosis: Diagnosis) -> str:
    """What the figure shows, for those who do not see it."""
    forces = diagnosis.responses
    assert isinstance(forces, DriveForces)

    def left(force: NDArray[np.float64]) -> str:
        return f"{np.sqrt(np.mean((forces.measured - force) ** 2)):.3g} N"

    return (
        f"Force of the drive over time, measured and as three models need it; rms left: {left(forces.before)} before,"
        f" {left(forces.recalibrated)} recalibrated, {left(forces.after)} after."
    )


def _explain(figure: Figure, axes: Axes) -> None:
    lines, _ = axes.get_legend_handles_labels()
    noise = Patch(color=PALE, label="noise of the measurement")
    figure.legend(handles=[*lines, noise], loc="outside upper center", ncols=5, columnspacing=1.2)
