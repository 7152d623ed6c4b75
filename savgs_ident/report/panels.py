"""The panels that response figures are made of; each draws one quantity of one channel over frequency.

Lines differ by dash and grey value, points by shape, so that nothing is lost without colour.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from savgs_ident.report.curves import MeasuredPoints, ModelCurve, phase_deg
from savgs_ident.report.readings import Shown
from savgs_ident.report.style import BLUE, GREY, INK, ORANGE, PALE, label_of, magnitude_axis

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
    axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int, shown: Shown
) -> None:
    """Magnitude of the first harmonic per metre of road, labelled for a legend."""
    magnitude_axis(axes)
    axes.set_ylabel(f"magnitude [{shown.per_road} of road]")
    for curve, line in zip(curves, LINES, strict=False):
        axes.plot(curve.frequency, np.abs(curve.transfer[:, c]), label=label_of(curve.label), **line)
    if measured is not None:
        error = _SIGMAS * measured.magnitude_sd[:, c]
        label = f"measured, ± {_SIGMAS:g} sd"
        axes.errorbar(measured.frequency, np.abs(measured.transfer[:, c]), error, label=label, **_POINTS)


def draw_phase(axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int) -> None:
    """Phase of the first harmonic against the road."""
    axes.set_ylabel("phase to the road [deg]")
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1.0, 1.5, 3.0, 4.5, 9.0, 10.0]))
    for curve, line in zip(curves, LINES, strict=False):
        axes.plot(curve.frequency, phase_deg(curve.transfer[:, c]), **line)
    if measured is not None:
        error = _SIGMAS * np.degrees(measured.phase_sd[:, c])
        axes.errorbar(measured.frequency, phase_deg(measured.transfer[:, c]), error, **_POINTS)


def draw_peak_to_peak(
    axes: Axes, curves: Sequence[ModelCurve], measured: MeasuredPoints | None, c: int, shown: Shown
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
