"""The panels of response figures: magnitude, phase, peak to peak and residuals of one channel over frequency.

Lines differ by dash and grey value, points by shape, so that nothing is lost without colour.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from savgs_ident.fit.residuals import MeasuredPoints
from savgs_ident.report.text import ChannelLabel
from savgs_ident.report.theme import BLUE, GREY, INK, ORANGE, PALE, magnitude_axis, printable
from savgs_ident.simulate.frequency_response import ModelCurve

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
        axes.plot(curve.frequency, np.abs(curve.transfer[:, c]), label=printable(curve.label), **line)
    if measured is not None:
        error = _SIGMAS * measured.magnitude_sd[:, c]
        label = f"measured, ± {_SIGMAS:g} sd"
        axes.errorbar(measured.frequency, np.abs(measured.transfer[:, c]), error, label=label, **_POINTS)


def draw_phase(
    axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int, shown: ChannelLabel
) -> None:
    """Phase of the first harmonic against the input."""
    axes.set_ylabel(f"phase to the {shown.input} [deg]")
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1.0, 1.5, 3.0, 4.5, 9.0, 10.0]))
    for curve, line in zip(curves, LINES, strict=False):
        axes.plot(curve.frequency, phase_deg(curve.transfer[:, c]), **line)
    if measured is not None:
        error = _SIGMAS * np.degrees(measured.phase_sd[:, c])
        axes.errorbar(measured.frequency, phase_deg(measured.transfer[:, c]), error, **_POINTS)


def draw_peak_to_peak(
    axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int, shown: ChannelLabel
) -> None:
    """Peak to peak of the waveform, as the paper plots it."""
    axes.set_ylabel(f"peak to peak [{shown.unit}]")
    for curve, line in zip(curves, LINES, strict=False):
        axes.plot(curve.frequency, shown.scale * curve.peak_to_peak[:, c], **line)
    if measured is not None:
        error = _SIGMAS * shown.scale * measured.peak_to_peak_sd[:, c]
        axes.errorbar(measured.frequency, shown.scale * measured.peak_to_peak[:, c], error, **_POINTS)
    axes.set_ylim(bottom=0.0)


def draw_residuals(axes: Axes, frequency: NDArray[np.float64], residuals: NDArray[np.float64]) -> None:
    """Whitened residuals (D, K, 2): both parts of every order, the first harmonic on top; labelled.

    ``frequency`` [Hz].
    """
    axes.set_ylabel("residual [noise sd]")
    axes.axhspan(-_SIGMAS, _SIGMAS, color=PALE, alpha=0.6, linewidth=0.0, zorder=0)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    first, others = residuals[:, 1:2], np.delete(residuals, 1, axis=1)
    _draw_parts(axes, frequency, others, "other orders", s=9, linewidths=0.6, color=GREY)
    _draw_parts(axes, frequency, first, "residual of the first harmonic", s=26, linewidths=1.1, color=BLUE)
    finite = np.abs(residuals[np.isfinite(residuals)])
    largest = max(float(np.max(finite, initial=0.0)), 4.0)
    axes.set_ylim(-1.1 * largest, 1.1 * largest)


def _draw_parts(
    axes: Axes, frequency: NDArray[np.float64], residuals: NDArray[np.float64], label: str, **look: Any
) -> None:
    """Residuals (D, K, 2): the real part as a plus, the imaginary part as a cross."""
    spread = np.broadcast_to(frequency[:, None], residuals.shape[:2])
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
