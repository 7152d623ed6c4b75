"""The posterior predictive band over the Bode plot.

The band holds 95 % of the first harmonics that the posterior predicts for a repetition of the campaign, noise and
discrepancy included. It is thin, a few thousandths of the response; so the lowest panel shows the distance of each
measured point from the middle of its band in half-widths of the band, for magnitude and phase.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from savgs_ident.fit.result import measured_points
from savgs_ident.inference.result import Posterior
from savgs_ident.report.bode import draw_magnitude, draw_phase, phase_deg
from savgs_ident.report.text import channel_labels
from savgs_ident.report.theme import BLUE, INK, ORANGE, frequency_axis, new_figure, styled
from savgs_ident.simulate.public import ModelCurve

_ENDS = (0.025, 0.975)
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
    """

    frequency: NDArray[np.float64]
    middle: NDArray[np.complex128]
    measured: NDArray[np.complex128]
    magnitude: NDArray[np.float64]
    phase: NDArray[np.float64]
    inside: NDArray[np.bool_]

    @property
    def misses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How far magnitude and phase lie off the middle of their bands, in units of half their widths, (D,) each."""
        turned = np.angle(self.measured * np.conj(self.middle))
        return _in_half_widths(np.abs(self.measured), self.magnitude), _in_half_widths(turned, self.phase)


def predictive_band(posterior: Posterior, c: int) -> Band:
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
        magnitude=np.quantile(np.abs(repeated), _ENDS, axis=0),
        phase=np.quantile(turned, _ENDS, axis=0),
        inside=predictive.inside[:, c, 1],
    )


def predictive_figure(posterior: Posterior, c: int) -> Figure:
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
        middle = phase_deg(band.middle)
        _draw_band(magnitude, band.frequency, band.magnitude)
        _draw_band(phase, band.frequency, middle + np.degrees(band.phase))
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
    return ModelCurve("model, mean of the draws", band.frequency, band.middle[:, None], unknown)


def _in_half_widths(values: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
    half = 0.5 * (ends[1] - ends[0])
    offset = values - 0.5 * (ends[1] + ends[0])
    return np.asarray(np.divide(offset, half, out=np.full(values.shape, np.nan), where=half > 0.0))


def _draw_band(axes: Axes, frequency: NDArray[np.float64], ends: NDArray[np.float64]) -> None:
    label = "95 % of repetitions"
    axes.fill_between(frequency, *ends, color=BLUE, alpha=0.35, linewidth=0.0, label=label)


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
    reach = 1.12 * max(float(np.max(finite, initial=0.0)), _LEAST_SHOWN)
    axes.set_ylim(-reach, reach)
