"""The Bode figure: measurement, identified model and model without friction, a column for each channel.

From the top: magnitude and phase of the first harmonic per unit of the input, peak to peak as the paper plots it,
and what the identified model leaves of each harmonic, in noise standard deviations.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from savgs_ident.fit.residuals import MeasuredPoints
from savgs_ident.report.panels import (
    draw_magnitude,
    draw_peak_to_peak,
    draw_phase,
    draw_residuals,
    fix_labels,
)
from savgs_ident.report.text import ChannelLabel
from savgs_ident.report.theme import frequency_axis, new_figure, printable, styled
from savgs_ident.simulate.frequency_response import ModelCurve

_COLUMN = 5.25
"""Width of a column [in]."""


def bode_figure(
    title: str,
    measured: MeasuredPoints,
    curves: Sequence[ModelCurve],
    residuals: NDArray[np.float64],
    labels: Sequence[ChannelLabel],
) -> Figure:
    """Draw ``measured`` against up to three ``curves``, the one that matters most first.

    ``residuals`` are the whitened residuals of the first, (D, C, K, 2), NaN where not used; ``labels`` say how the C
    channels are shown.
    """
    with styled():
        figure = new_figure(_COLUMN * len(labels), 13.0)
        grid = figure.subplots(4, len(labels), squeeze=False, height_ratios=(1.25, 0.9, 1.25, 0.9))
        for c, (column, shown) in enumerate(zip(grid.T, labels, strict=True)):
            column[0].set_title(shown.title)
            draw_magnitude(column[0], curves, measured, c, shown)
            draw_phase(column[1], curves, measured, c, shown)
            draw_peak_to_peak(column[2], curves, measured, c, shown)
            draw_residuals(column[3], measured.frequency, residuals[:, c])
            for axes in column:
                lowest, highest = float(measured.frequency[0]), float(measured.frequency[-1])
                frequency_axis(axes, lowest, highest, labelled=axes is column[-1])
                fix_labels(axes)
        _share_legend(figure, title)
        _explain_residuals(figure, grid[-1, 0])
        return figure


def response_figure(title: str, curves: Sequence[ModelCurve], labels: Sequence[ChannelLabel]) -> Figure:
    """Magnitude, phase and peak to peak of up to three simulated ``curves``."""
    with styled():
        figure = new_figure(_COLUMN * len(labels), 10.0)
        grid = figure.subplots(3, len(labels), squeeze=False, height_ratios=(1.25, 0.9, 1.25))
        frequency = np.concatenate([curve.frequency for curve in curves])
        for c, (column, shown) in enumerate(zip(grid.T, labels, strict=True)):
            column[0].set_title(shown.title)
            draw_magnitude(column[0], curves, None, c, shown)
            draw_phase(column[1], curves, None, c, shown)
            draw_peak_to_peak(column[2], curves, None, c, shown)
            for axes in column:
                _mark_solved(axes)
                frequency_axis(axes, frequency.min(), frequency.max(), labelled=axes is column[-1])
                fix_labels(axes)
        _share_legend(figure, title)
        return figure


def _mark_solved(axes: Axes) -> None:
    """Points where the model was solved; the line between them only guides the eye."""
    for line in axes.get_lines():
        line.set(marker="o", markersize=3.5, markerfacecolor="white")


def _share_legend(figure: Figure, title: str) -> None:
    """One legend for all panels, headed by the title, from the labels of the first panel."""
    handles, labels = figure.axes[0].get_legend_handles_labels()
    legend = figure.legend(
        handles, labels, loc="outside upper center", ncols=len(labels), fontsize=9.5, title=printable(title)
    )
    legend.get_title().set(fontsize=11, fontweight="bold")


def _explain_residuals(figure: Figure, panel: Axes) -> None:
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
