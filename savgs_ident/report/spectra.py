"""The figures of tests that do not repeat: what is compared over frequency, and what a posterior predicts.

Of a fit, a column for each channel. Above, root mean squares over the windows: of the measurement, the model, the
model without its effects, what the model misses, and the noise. Below, what the model leaves of each number, in noise
standard deviations.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from savgs_ident.fit.public import Comparison
from savgs_ident.fit.result import OverWindows, recorded_spectra, whitened
from savgs_ident.inference.result import HarmonicPosterior
from savgs_ident.report.bode import LINES, PREDICTED, draw_residuals, share_legends
from savgs_ident.report.text import channel_labels
from savgs_ident.report.theme import BLUE, INK, ORANGE, magnitude_axis, new_figure, styled


def spectra_figure(title: str, compared: Comparison) -> Figure:
    """Draw what a model is held against in windows, and what it misses."""
    labels = {
        name: shown
        for name, shown in channel_labels(compared.given).items()
        if name in compared.measured.channels
    }
    places = [c for c, each in enumerate(compared.given.channels) if each.name in labels]
    residuals = whitened(
        compared.measured, tuple(labels), compared.model.harmonics[:, places], compared.used[:, places]
    )
    with styled():
        figure = new_figure(5.25 * len(labels), 8.0)
        grid = figure.subplots(2, len(labels), squeeze=False, height_ratios=(1.25, 0.9))
        for row, (c, column, (name, shown)) in enumerate(zip(places, grid.T, labels.items(), strict=True)):
            column[0].set_title(shown.title)
            column[0].set_ylabel(f"amplitude, rms over windows [{shown.unit}]")
            _draw_spectra(column[0], compared, c, name, shown.scale)
            magnitude_axis(column[0])
            spacing = compared.measured.spacing
            order = np.arange(residuals.shape[2])
            draw_residuals(column[1], np.outer(spacing, order), residuals[:, row])
            column[1].set_xlabel("frequency [Hz]")
        share_legends(figure, title, grid[-1, 0])
        return figure


def _draw_spectra(axes: Axes, compared: Comparison, c: int, name: str, scale: float) -> None:
    over = OverWindows.of(compared.measured, compared.used[:, c])
    recorded, noise = recorded_spectra(compared.measured, name, compared.used.shape[2])
    model, without = compared.model.harmonics[:, c], compared.frictionless.harmonics[:, c]

    def rms(values: NDArray[np.complex128]) -> NDArray[np.float64]:
        return scale * over.rms(np.abs(values) ** 2)

    axes.semilogy(over.frequency, rms(recorded), "o", color=INK, ms=4.0, mfc="white", label="measured")
    axes.semilogy(over.frequency, rms(model), label="model", **LINES[0])
    if compared.effects:
        axes.semilogy(over.frequency, rms(without), label="without its effects", **LINES[1])
    axes.semilogy(over.frequency, rms(recorded - model), ".-", color=ORANGE, lw=0.8, label="missed")
    axes.semilogy(over.frequency, scale * over.rms(noise), label="noise", **LINES[2])


def predicted_spectrum(
    posterior: HarmonicPosterior, c: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz], (n,); what channel ``c`` read there, (n,); what 95 % of repetitions lie between, (2, n).

    Root mean squares over the windows, SI.
    """
    predictive, orders = posterior.predictive, posterior.predictive.used.shape[2]
    over = OverWindows.of(posterior.measured, predictive.used[:, c])
    recorded, _ = recorded_spectra(posterior.measured, posterior.model.channels[c].name, orders)
    repeated = over.rms(np.abs(predictive.replicated[:, :, c]) ** 2)
    return over.frequency, over.rms(np.abs(recorded) ** 2), np.quantile(repeated, PREDICTED, axis=0)


def predicted_spectrum_figure(posterior: HarmonicPosterior, c: int) -> Figure:
    """What a posterior predicts for one channel in windows: the spectrum, and how far off it the recorded one is."""
    shown = tuple(channel_labels(posterior.model).values())[c]
    frequency, recorded, ends = predicted_spectrum(posterior, c)
    off = (recorded - 0.5 * (ends[0] + ends[1])) / (0.5 * (ends[1] - ends[0]))
    with styled():
        figure = new_figure(4.5, 5.6)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
        above.set_title(shown.title)
        above.set_ylabel(f"amplitude, rms over windows [{shown.unit}]")
        above.fill_between(
            frequency,
            *(shown.scale * ends),
            color=BLUE,
            alpha=0.35,
            linewidth=0.0,
            label="95 % of repetitions",
        )
        above.plot(frequency, shown.scale * recorded, "o", color=INK, ms=4.0, mfc="white", label="measured")
        magnitude_axis(above)
        above.legend(loc="best")
        below.axhspan(-1.0, 1.0, color=BLUE, alpha=0.15, linewidth=0.0, zorder=0)
        below.axhline(0.0, color=INK, linewidth=0.8)
        below.plot(frequency, off, "o", color=BLUE, ms=4.0, mfc="white")
        limit = 1.12 * max(float(np.max(np.abs(off))), 2.0)
        below.set_ylim(-limit, limit)
        below.set_ylabel("distance [band half-widths]")
        below.set_xlabel("frequency [Hz]")
        return figure
