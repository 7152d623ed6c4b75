"""Figures of an H-infinity design: gamma, the sensitivity of the loop, ride, robustness, regularising weights."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from savgs_ident.control.design import FACTORS, REGULARISATION, Design
from savgs_ident.control.linear_equivalent import quarter_car_space
from savgs_ident.control.synthesis import Robustness, open_loop, sensitivity, singular_values
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.report.control.design_text import WEIGHT_WORDS, is_reduced
from savgs_ident.report.text import response_labels
from savgs_ident.report.theme import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    frequency_axis,
    magnitude_axis,
    new_figure,
    styled,
)

_READINGS = response_labels(RIG_LAYOUT)
"""The responses that are compared."""

WIDE = np.logspace(-2.0, 2.0, 801)
"""Frequencies of the closed loop [Hz]."""

RIDE = np.geomspace(0.5, 20.0, 400)
"""Frequencies of the road [Hz]."""

_MAIN: Mapping[str, Any] = MappingProxyType({"color": BLUE, "linewidth": 1.8})
_OTHER: Mapping[str, Any] = MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.5})
_BOUND: Mapping[str, Any] = MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.4})
_WEIGHT_LOOKS: tuple[Mapping[str, Any], ...] = (
    MappingProxyType({"color": BLUE, "linestyle": "-", "marker": "o"}),
    MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "marker": "s"}),
    MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "marker": "^"}),
    MappingProxyType({"color": INK, "linestyle": (0, (6, 1.5, 1, 1.5)), "marker": "D"}),
)


def gamma_figure(design: Design) -> Figure:
    """Singular values of the closed loop from disturbances to penalties, against gamma; near gamma on the right."""
    synthesis = design.synthesis
    values = singular_values(synthesis.closed, WIDE)
    with styled():
        figure = new_figure(10.5, 4.4)
        panels = figure.subplots(1, 2)
        for axes in panels:
            axes.plot(WIDE, values[:, 0], label="largest singular value", **_MAIN)
            axes.axhline(synthesis.gamma, label=f"gamma = {synthesis.gamma:.3f}", **_BOUND)
            _decades(axes)
        whole, near = panels
        for place, others in enumerate(values.T[1:]):
            whole.plot(WIDE, others, label=None if place else "the others", **_OTHER)
        if is_reduced(design):
            _draw_reduced(whole, design)
        magnitude_axis(whole)
        whole.set_ylim(1e-3, 2.0 * synthesis.gamma)
        whole.set_ylabel("singular values of the closed loop [1]")
        near.set_ylim(0.95 * synthesis.gamma, 1.03 * max(synthesis.gamma, synthesis.peak))
        near.set_ylabel("the largest, near gamma [1]")
        _mark(near, synthesis.peak_frequency, synthesis.peak, f"peak {synthesis.peak:.3f}")
        handles, labels = whole.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return figure


def _draw_reduced(axes: Axes, design: Design) -> None:
    """The largest singular value with the controller of lower order."""
    used = singular_values(design.closed, WIDE)[:, 0]
    words = f"with the controller of order {design.controller.nstates}"
    axes.plot(WIDE, used, color=INK, linewidth=1.0, linestyle=(0, (6, 1.5, 1, 1.5)), label=words)


def sensitivity_figure(design: Design) -> Figure:
    """The sensitivity of the loop, continuous and, where that is stable, sampled, with the higher peak."""
    curves = [("continuous", WIDE, np.abs(sensitivity(open_loop(design.plant, design.controller), WIDE)))]
    if design.digital_margins.stable:
        curves.append((f"sampled at {design.digital.rate:g} Hz", *_sampled_sensitivity(design)))
    with styled():
        figure = new_figure(10.5, 4.0)
        axes = figure.subplots()
        for (label, frequency, values), look in zip(curves, (_MAIN, _BOUND), strict=False):
            axes.plot(frequency, values, label=label, **look)
        axes.axhline(1.0, color=INK, linewidth=0.7)
        _, frequency, values = max(curves, key=lambda curve: float(curve[2].max()))
        top = int(np.argmax(values))
        _mark(axes, float(frequency[top]), float(values[top]), f"peak {values[top]:.2f}")
        _decades(axes)
        axes.set_ylim(0.0, 1.2 * values[top])
        axes.set_ylabel("magnitude of the sensitivity 1/(1 + L) [1]")
        axes.legend(loc="upper left")
        return figure


def _sampled_sensitivity(design: Design) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies below half the rate [Hz], and the magnitude of the sampled loop's sensitivity there."""
    rate = design.digital.rate
    below = WIDE[: np.searchsorted(WIDE, 0.5 * rate)]
    loop = open_loop(design.sampled_plant, design.digital.space)
    return below, np.abs(1.0 / (1.0 + np.ravel(loop(np.exp(2j * np.pi * below / rate)))))


def ride_figure(design: Design) -> Figure:
    """From the road to acceleration and deflection: eq. (8) with its link held, and with the controller."""
    passive, active = ride_responses(design, RIDE)
    with styled():
        figure = new_figure(10.5, 4.4)
        panels = figure.subplots(1, len(_READINGS))
        for c, (axes, shown) in enumerate(zip(panels, _READINGS.values(), strict=True)):
            axes.set_title(shown.title)
            axes.set_ylabel(f"magnitude [{shown.per_input} of road]")
            axes.plot(RIDE, np.abs(passive[:, c]), label="passive, link held", **_BOUND)
            axes.plot(RIDE, np.abs(active[:, c]), label="active, loop closed", **_MAIN)
            magnitude_axis(axes)
            frequency_axis(axes, float(RIDE[0]), float(RIDE[-1]))
            axes.legend(loc="lower right")
        return figure


def ride_responses(
    design: Design, frequency: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Acceleration and deflection per metre of road at F frequencies [Hz], each (F, 2): passive and active."""
    iw = 2j * np.pi * frequency
    passive, active = (
        np.stack([space(iw, squeeze=False)[row, 0] for row in (0, 1)], axis=-1) * iw[:, None]
        for space in (quarter_car_space(design.masses), design.ride)
    )
    return passive, active


def robustness_figure(design: Design) -> Figure:
    """Peak of the closed loop and phase margin on every rig, the rigs in the order of their peaks."""
    found = design.robustness
    order = np.argsort(found.peaks, kind="stable")
    margins = np.array([each.phase_deg if each.stable else np.nan for each in found.margins])
    peaks = np.where(np.isfinite(found.peaks), found.peaks, np.nan)
    with styled():
        figure = new_figure(10.5, 4.0)
        left, right = figure.subplots(1, 2)
        for axes, values, nominal, label in (
            (left, peaks, design.synthesis.gamma, "peak of the closed loop [1]"),
            (right, margins, design.margins.phase_deg, "phase margin [deg]"),
        ):
            places = np.arange(1, order.size + 1)
            axes.plot(places, values[order], color=BLUE, linestyle="none", marker="o", markersize=4.0)
            words = "gamma" if axes is left else "nominal rig"
            axes.axhline(nominal, label=words, **_BOUND)
            axes.set_ylabel(label)
            axes.set_xlabel("rig, by growing peak")
            axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
            _mark_unstable(axes, found, order)
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
        return figure


def regularisation_figure(design: Design) -> Figure:
    """What each regularising weight does: least gamma, phase margin and fastest pole over its factor."""
    panels = (
        ("gamma_least", "least gamma [1]"),
        ("phase_deg", "phase margin [deg]"),
        ("fastest_pole", "fastest pole of the controller [rad/s]"),
    )
    with styled():
        figure = new_figure(10.5, 4.2)
        grid = figure.subplots(1, len(panels))
        for axes, (name, label) in zip(grid, panels, strict=True):
            _draw_factors(axes, design, name)
            axes.set_ylabel(label)
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return figure


def _draw_factors(axes: Axes, design: Design, name: str) -> None:
    """One figure of merit over the factors, a line for each weight."""
    for weight, look in zip(REGULARISATION, _WEIGHT_LOOKS, strict=True):
        rows = [each for each in design.regularisation if each.weight == weight]
        values = [getattr(each, name) for each in rows]
        factors = [each.factor for each in rows]
        axes.plot(factors, values, label=WEIGHT_WORDS[weight], markersize=4.5, linewidth=1.4, **look)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(FACTORS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel("weight, times [1]")
    axes.ticklabel_format(axis="y", useOffset=False)


def _decades(axes: Axes) -> None:
    """A frequency axis over :data:`WIDE` with the decades written out."""
    axes.set_xscale("log")
    axes.set_xlim(WIDE[0], WIDE[-1])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel("frequency [Hz]")


def _mark(axes: Axes, at: float, value: float, words: str) -> None:
    """A peak with its words above."""
    axes.plot(at, value, color=INK, marker="v", markersize=6.0, linestyle="none")
    axes.annotate(f"{words} at {at:.2f} Hz", (at, value), (0, 14), textcoords="offset points", ha="center")


def _mark_unstable(axes: Axes, found: Robustness, order: NDArray[np.intp]) -> None:
    """A cross at the top for every rig whose loop is not stable."""
    places = [place + 1 for place, rig in enumerate(order) if not found.margins[rig].stable]
    if places:
        top = axes.get_ylim()[1]
        axes.plot(
            places, [top] * len(places), "x", color=ORANGE, markersize=7.0, label="not stable", clip_on=False
        )
