"""The figure of a fit to tests that do not repeat: what is compared, over frequency.

A column for each channel. Above, root mean squares over the windows: of the measurement, the model, the model without
its effects, what the model misses, and the noise. Below, what the model leaves of each number, in noise standard
deviations.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from savgs_ident.fit.public import Comparison
from savgs_ident.fit.result import whitened
from savgs_ident.report.bode import LINES, draw_residuals, share_legends
from savgs_ident.report.text import channel_labels
from savgs_ident.report.theme import INK, ORANGE, magnitude_axis, new_figure, styled


def spectra_figure(title: str, compared: Comparison) -> Figure:
    """Draw what a model is held against in windows, and what it misses."""
    labels = channel_labels(compared.given)
    residuals = whitened(compared.measured, tuple(labels), compared.model.harmonics, compared.used)
    with styled():
        figure = new_figure(5.25 * len(labels), 8.0)
        grid = figure.subplots(2, len(labels), squeeze=False, height_ratios=(1.25, 0.9))
        for c, (column, (name, shown)) in enumerate(zip(grid.T, labels.items(), strict=True)):
            column[0].set_title(shown.title)
            column[0].set_ylabel(f"amplitude, rms over windows [{shown.unit}]")
            _draw_spectra(column[0], compared, c, name, shown.scale)
            magnitude_axis(column[0])
            spacing = compared.measured.spacing
            order = np.arange(residuals.shape[2])
            draw_residuals(column[1], np.outer(spacing, order), residuals[:, c])
            column[1].set_xlabel("frequency [Hz]")
        share_legends(figure, title, grid[-1, 0])
        return figure


def _draw_spectra(axes: Axes, compared: Comparison, c: int, name: str, scale: float) -> None:
    measured, used = compared.measured, compared.used[:, c]
    place, orders = measured.channel(name), used.shape[1]
    known = np.flatnonzero(used.any(axis=0))
    frequency = float(measured.spacing[0]) * known

    def rms(squares: NDArray[np.float64]) -> NDArray[np.float64]:
        total = np.sum(np.where(used, squares, 0.0), axis=0)
        return np.asarray(scale * np.sqrt(total[known] / np.sum(used, axis=0)[known]))

    recorded = measured.harmonics[:, place, :orders]
    noise = np.trace(measured.covariance[:, place, :orders], axis1=-2, axis2=-1)
    model, without = compared.model.harmonics[:, c], compared.frictionless.harmonics[:, c]
    axes.semilogy(
        frequency, rms(np.abs(recorded) ** 2), "o", color=INK, ms=4.0, mfc="white", label="measured"
    )
    axes.semilogy(frequency, rms(np.abs(model) ** 2), label="model", **LINES[0])
    if compared.effects:
        axes.semilogy(frequency, rms(np.abs(without) ** 2), label="without its effects", **LINES[1])
    axes.semilogy(frequency, rms(np.abs(recorded - model) ** 2), ".-", color=ORANGE, lw=0.8, label="missed")
    axes.semilogy(frequency, rms(noise), label="noise", **LINES[2])
