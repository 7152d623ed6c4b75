"""Bode figures: measurement against models, and the predictive band of a posterior.

:func:`bode_figure` has a column for each channel: measurement, identified model and model without friction. From the
top: magnitude and phase of the first harmonic per unit of the input, peak to peak as the paper plots it, and what the
identified model leaves of each harmonic, in noise standard deviations. The panels are those of the figures of
posterior and diagnosis too. Lines differ by dash and grey value, points by shape, so that nothing is lost without
colour.

:func:`predictive_figure` has the band that holds 95 % of the first harmonics that a posterior predicts for a
repetition of the campaign, noise and discrepancy included. It is thin, a few thousandths of the response; so the
lowest panel shows the distance of each measured point from the middle of its band in half-widths of the band, for
magnitude and phase.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from savgs_ident.fit.result import MeasuredPoints, measured_points
from savgs_ident.inference.result import HarmonicPosterior
from savgs_ident.report.text import ChannelLabel, channel_labels
from savgs_ident.report.theme import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    frequency_axis,
    magnitude_axis,
    new_figure,
    printable,
    styled,
)
from savgs_ident.simulate.curves import ModelCurve, measured_programmes

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
        share_legends(figure, title, grid[-1, 0])
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


def share_legends(figure: Figure, title: str, panel: Axes) -> None:
    """The same, and one below for the ``panel`` of residuals."""
    _share_legend(figure, title)
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))


LINES: tuple[Mapping[str, Any], ...] = (
    MappingProxyType({"color": BLUE, "linestyle": "-", "linewidth": 1.7}),
    MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.4}),
    MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.6}),
)
"""How the first, second and third curve of a figure look."""

_POINTS: Mapping[str, Any] = MappingProxyType(
    {
        "fmt": "o",
        "color": INK,
        "markersize": 4.0,
        "markerfacecolor": "white",
        "zorder": 5,
        "capsize": 2.0,
        "elinewidth": 0.9,
    }
)
_SIGMAS = 2.0


def draw_magnitude(
    axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int, shown: ChannelLabel
) -> None:
    """Magnitude of the first harmonic per unit of the input, labelled for a legend."""
    magnitude_axis(axes)
    axes.set_ylabel(f"magnitude [{shown.per_input} of {shown.input}]")
    for curve, line in zip(curves, LINES, strict=False):
        _draw_lines(axes, curve, np.abs(curve.transfer[:, c]), **line)
    if measured is not None:
        error = _SIGMAS * measured.magnitude_sd[:, c]
        label = f"measured, ± {_SIGMAS:g} sd"
        axes.errorbar(measured.frequency, np.abs(measured.transfer[:, c]), error, label=label, **_POINTS)


def _phase_of(curve: ModelCurve, c: int) -> NDArray[np.float64]:
    """Phase of a channel [deg], (F,), without jumps along each line."""
    lines = curve.programme if curve.programme.size else np.zeros(curve.frequency.size, np.intp)
    return _phase_of_lines(curve.transfer[:, c], lines)


def _phase_of_lines(transfer: NDArray[np.complex128], programme: NDArray[np.intp]) -> NDArray[np.float64]:
    """The same of a transfer (F,) on lines with these numbers, (F,)."""
    phase = np.full(transfer.size, np.nan)
    for each in np.unique(programme):
        phase[programme == each] = phase_deg(transfer[programme == each])
    return phase


def _draw_lines(axes: Axes, curve: ModelCurve, values: NDArray[np.float64], **look: Any) -> None:
    """A line for each programme of a curve, the first one labelled."""
    label = printable(curve.label)
    for places in curve.lines:
        axes.plot(curve.frequency[places], values[places], label=label, **look)
        label = "_nolegend_"


def draw_phase(
    axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int, shown: ChannelLabel
) -> None:
    """Phase of the first harmonic against the input."""
    axes.set_ylabel(f"phase to the {shown.input} [deg]")
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1.0, 1.5, 3.0, 4.5, 9.0, 10.0]))
    for curve, line in zip(curves, LINES, strict=False):
        _draw_lines(axes, curve, _phase_of(curve, c), **line)
    if measured is not None:
        error = _SIGMAS * np.degrees(measured.phase_sd[:, c])
        phase = _phase_of_lines(measured.transfer[:, c], measured.programme)
        axes.errorbar(measured.frequency, phase, error, **_POINTS)


def draw_peak_to_peak(
    axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int, shown: ChannelLabel
) -> None:
    """Peak to peak of the waveform, as the paper plots it."""
    axes.set_ylabel(f"peak to peak [{shown.unit}]")
    for curve, line in zip(curves, LINES, strict=False):
        _draw_lines(axes, curve, shown.scale * curve.peak_to_peak[:, c], **line)
    if measured is not None:
        error = _SIGMAS * shown.scale * measured.peak_to_peak_sd[:, c]
        axes.errorbar(measured.frequency, shown.scale * measured.peak_to_peak[:, c], error, **_POINTS)
    axes.set_ylim(bottom=0.0)


def draw_residuals(axes: Axes, frequency: NDArray[np.float64], residuals: NDArray[np.float64]) -> None:
    """Whitened residuals (D, K, 2): both parts of every order, the first harmonic on top; labelled.

    ``frequency`` [Hz] is that of each test, (D,), or of each order, (D, K), none of which is the first harmonic then.
    """
    axes.set_ylabel("residual [noise sd]")
    axes.axhspan(-_SIGMAS, _SIGMAS, color=PALE, alpha=0.6, linewidth=0.0, zorder=0)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    if frequency.ndim == 2:
        _draw_parts(axes, frequency, residuals, "residual", s=9, linewidths=0.6, color=BLUE)
    else:
        first, others = residuals[:, 1:2], np.delete(residuals, 1, axis=1)
        _draw_parts(axes, frequency[:, None], others, "other orders", s=9, linewidths=0.6, color=GREY)
        label = "residual of the first harmonic"
        _draw_parts(axes, frequency[:, None], first, label, s=26, linewidths=1.1, color=BLUE)
    finite = np.abs(residuals[np.isfinite(residuals)])
    largest = max(float(np.max(finite, initial=0.0)), 4.0)
    axes.set_ylim(-1.1 * largest, 1.1 * largest)


def _draw_parts(
    axes: Axes, frequency: NDArray[np.float64], residuals: NDArray[np.float64], label: str, **look: Any
) -> None:
    """Residuals (D, K, 2): the real part as a plus, the imaginary part as a cross."""
    spread = np.broadcast_to(frequency, residuals.shape[:2])
    axes.scatter(spread, residuals[..., 0], marker="+", label=f"{label}, Re", **look)
    axes.scatter(spread, residuals[..., 1], marker="x", label=f"{label}, Im", **look)


def fix_labels(axes: Axes) -> None:
    """Put the labels of an axes at a fixed distance, which also aligns them with those of its neighbours.

    Left to themselves they look for room among all ticks of all neighbours, half of the time that a figure takes.
    """
    axes.yaxis.set_label_coords(-0.125, 0.5)
    if not axes.get_xlabel():
        axes.xaxis.set_label_coords(0.5, 0.0)
    axes.set_title(axes.get_title(), y=1.0)


def phase_deg(transfer: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Phase of one channel over frequency [deg], (n,), without jumps, beginning within [-90, 270).

    A suspension's readings begin between 0 and 180 deg: neither end of that range is near.
    """
    known = np.isfinite(transfer)
    phase = np.full(transfer.shape, np.nan)
    if np.any(known):
        unwrapped = np.degrees(np.unwrap(np.angle(transfer[known])))
        phase[known] = unwrapped - 360.0 * np.floor((unwrapped[0] + 90.0) / 360.0)
    return phase


PREDICTED = (0.025, 0.975)
"""Ends of the band in which 95 % of the repetitions lie."""

_LEAST_SHOWN = 2.0


@dataclass(frozen=True)
class Band:
    """First harmonics of one channel per unit of the input, over D dwells; NaN where nothing is compared.

    Attributes:
        frequency: [Hz], (D,).
        middle: mean of the model at the draws [unit/input], complex, (D,).
        measured: as measured [unit/input], complex, (D,).
        magnitude: ends of the 95 % band of the magnitude [unit/input], (2, D).
        phase: ends of the 95 % band of the phase about that of ``middle`` [rad], (2, D).
        inside: whether the measured magnitude and phase together lie within 95 %, (D,).
        programme: number of the line that each dwell is on, (D,).
    """

    frequency: NDArray[np.float64]
    middle: NDArray[np.complex128]
    measured: NDArray[np.complex128]
    magnitude: NDArray[np.float64]
    phase: NDArray[np.float64]
    inside: NDArray[np.bool_]
    programme: NDArray[np.intp]

    @property
    def misses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How far magnitude and phase lie off the middle of their bands, in units of half their widths, (D,) each."""
        turned = np.angle(self.measured * np.conj(self.middle))
        return _in_half_widths(np.abs(self.measured), self.magnitude), _in_half_widths(turned, self.phase)


def predictive_band(posterior: HarmonicPosterior, c: int) -> Band:
    """The band of the first harmonic of the plant's channel ``c``."""
    predictive, measured = posterior.predictive, posterior.measured
    input_name = posterior.model.plant.inputs[0].name
    points = measured_points(measured, [each.name for each in posterior.model.channels], input_name)
    driven = measured.harmonics[:, measured.channel(input_name), 1]
    used = predictive.used[:, c, 1]
    repeated = np.where(used, predictive.replicated[:, :, c, 1] / driven, np.nan)
    middle = np.where(used, np.mean(predictive.model[:, :, c, 1], axis=0) / driven, np.nan)
    turned = np.angle(repeated * np.conj(middle))
    return Band(
        frequency=measured.frequency,
        middle=middle,
        measured=np.where(used, points.transfer[:, c], np.nan),
        magnitude=np.quantile(np.abs(repeated), PREDICTED, axis=0),
        phase=np.quantile(turned, PREDICTED, axis=0),
        inside=predictive.inside[:, c, 1],
        programme=measured_programmes(measured, posterior.model.plant),
    )


def predictive_figure(posterior: HarmonicPosterior, c: int) -> Figure:
    """Magnitude, phase and distance from the band of one channel."""
    band, shown = predictive_band(posterior, c), tuple(channel_labels(posterior.model).values())[c]
    curve = _curve(band)
    with styled():
        figure = new_figure(4.5, 7.2)
        figure.set_layout_engine("none")
        places = {"left": 0.155, "right": 0.985, "bottom": 0.065, "top": 0.965, "hspace": 0.17}
        panels = figure.subplots(3, 1, height_ratios=(1.25, 0.9, 1.0), gridspec_kw=places)
        magnitude, phase, misses = panels
        magnitude.set_title(shown.title)
        draw_magnitude(magnitude, [curve], None, 0, shown)
        draw_phase(phase, [curve], None, 0, shown)
        middle = _phase_of(curve, 0)
        _draw_band(magnitude, curve, band.magnitude)
        _draw_band(phase, curve, middle + np.degrees(band.phase))
        _draw_points(magnitude, band, np.abs(band.measured))
        _draw_points(phase, band, middle + np.degrees(np.angle(band.measured * np.conj(band.middle))))
        _draw_misses(misses, band)
        for axes in panels:
            lowest, highest = float(band.frequency[0]), float(band.frequency[-1])
            frequency_axis(axes, lowest, highest, labelled=axes is misses)
            axes.yaxis.set_label_coords(-0.145, 0.5)
        magnitude.legend(loc="best")
        misses.legend(
            loc="upper center", bbox_to_anchor=(0.5, 1.17), ncols=3, handletextpad=0.1, columnspacing=1.0
        )
        return figure


def _curve(band: Band) -> ModelCurve:
    unknown = np.full((band.frequency.size, 1), np.nan)
    label = "model, mean of the draws"
    return ModelCurve(label, band.frequency, band.middle[:, None], unknown, band.programme)


def _in_half_widths(values: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
    half = 0.5 * (ends[1] - ends[0])
    offset = values - 0.5 * (ends[1] + ends[0])
    return np.asarray(np.divide(offset, half, out=np.full(values.shape, np.nan), where=half > 0.0))


def _draw_band(axes: Axes, curve: ModelCurve, ends: NDArray[np.float64]) -> None:
    label = "95 % of repetitions"
    for places in curve.lines:
        axes.fill_between(
            curve.frequency[places], *ends[:, places], color=BLUE, alpha=0.35, linewidth=0.0, label=label
        )
        label = "_nolegend_"


def _draw_points(axes: Axes, band: Band, values: NDArray[np.float64]) -> None:
    for mask, face, label in ((band.inside, "white", "measured"), (~band.inside, ORANGE, None)):
        axes.plot(
            band.frequency[mask],
            values[mask],
            label=label,
            linestyle="none",
            marker="o",
            markersize=4.0,
            markeredgewidth=0.9,
            color=INK,
            markerfacecolor=face,
            zorder=5,
        )


def _draw_misses(axes: Axes, band: Band) -> None:
    axes.axhspan(-1.0, 1.0, color=BLUE, alpha=0.15, linewidth=0.0, zorder=0)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    for values, marker, label in zip(band.misses, "ox", ("magnitude", "phase"), strict=True):
        axes.scatter(
            band.frequency[band.inside], values[band.inside], marker=marker, s=24, linewidths=1.0, label=label,
            color=BLUE, facecolors="white" if marker == "o" else BLUE, zorder=4,
        )  # fmt: skip
        out = ~band.inside
        axes.scatter(
            band.frequency[out], values[out], marker=marker, s=40, linewidths=1.6,
            color=ORANGE, facecolors="white" if marker == "o" else ORANGE, zorder=5,
        )  # fmt: skip
    axes.scatter([], [], marker="s", s=40, color=ORANGE, label="together outside")
    axes.set_ylabel("distance [band half-widths]")
    finite = np.concatenate([np.abs(values[np.isfinite(values)]) for values in band.misses])
    limit = 1.12 * max(float(np.max(finite, initial=0.0)), _LEAST_SHOWN)
    axes.set_ylim(-limit, limit)
