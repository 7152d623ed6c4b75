"""Figures of the linear models: the equivalent over the link angle, small motions, motions of the test."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from savgs_ident.control.describing_function import ELEMENTS
from savgs_ident.control.linear_study import (
    WISHBONE_DEG,
    CamMotions,
    EquivalentStudy,
    LinearStudy,
    SmallMotions,
)
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.report.control.linear_text import ELEMENT_WORDS, sign_of_alpha
from savgs_ident.report.text import response_labels
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

_READINGS = response_labels(RIG_LAYOUT)
"""The responses that are compared."""

_CURVE: Mapping[str, Any] = MappingProxyType({"color": BLUE, "linewidth": 1.8})
_CONSTANT: Mapping[str, Any] = MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.6})
_PARABOLA: Mapping[str, Any] = MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.4})
_NONLINEAR: Mapping[str, Any] = MappingProxyType(
    {"color": INK, "linestyle": "none", "marker": "o", "markersize": 4.5, "markerfacecolor": "white"}
)
_STEPS: tuple[Mapping[str, Any], ...] = (
    MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.5}),
    MappingProxyType({"color": INK, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 1.1}),
    MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.8}),
    MappingProxyType({"color": BLUE, "linestyle": "-", "linewidth": 1.7}),
)
"""How the linear models look, from equation (8) to the exact one."""

_ELEMENT_LOOKS: tuple[Mapping[str, Any], ...] = (
    MappingProxyType({"color": BLUE, "linestyle": "-", "marker": "o"}),
    MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "marker": "s"}),
    MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "marker": "^"}),
)


def linear_figures(study: LinearStudy) -> dict[str, Figure]:
    """The figures of a study by the names of their files."""
    figures = {"alpha": alpha_figure(study.equivalents), "responses": responses_figure(study.small)}
    return figures if study.at_test is None else figures | {"described": described_figure(study.at_test)}


def alpha_figure(study: EquivalentStudy) -> Figure:
    """k_eq, c_eq and the magnitude of alpha over the link angle, with what stands for them: Fig. 7 of the paper."""
    itself = sign_of_alpha(study)
    panels = (
        ("k_eq", 1e-3, "equivalent stiffness k_eq [kN/m]"),
        ("c_eq", 1e-3, "equivalent damping c_eq [kN s/m]"),
        (
            "alpha",
            1e3 if itself == "positive" else -1e3,
            f"magnitude of alpha [mm/rad]\n(alpha itself is {itself})",
        ),
    )
    with styled():
        figure = new_figure(10.5, 4.2)
        grid = figure.subplots(1, len(panels))
        for axes, (name, scale, label) in zip(grid, panels, strict=True):
            _draw_equivalent(axes, study, name, scale)
            axes.set_ylabel(label)
        handles, labels = grid[-1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return figure


def _draw_equivalent(axes: Axes, study: EquivalentStudy, name: str, scale: float) -> None:
    """One part of the equivalent, times ``scale``, over the link angle."""
    link, exact = study.link_deg, scale * getattr(study.resting, name)
    surface = scale * getattr(study.surface, name)
    ends = f"wishbone within ± {WISHBONE_DEG[-1]:g} deg"
    axes.fill_between(
        link, np.nanmin(surface, axis=1), np.nanmax(surface, axis=1), color=PALE, linewidth=0.0, label=ends
    )
    axes.plot(link, exact, label="wishbone at rest", **_CURVE)
    constant, parabola = f"{name} by a constant", f"{name} by a parabola"
    for key, label, look in (
        (constant, "nearest constant", _CONSTANT),
        (parabola, "nearest parabola", _PARABOLA),
    ):
        if key in study.approximations:
            axes.plot(link, scale * study.approximations[key](np.radians(link)), label=label, **look)
    axes.set_xticks(np.arange(0.0, 181.0, 30.0))
    axes.set_xlim(0.0, 180.0)
    axes.set_ylim(bottom=0.0 if name == "alpha" else None)
    axes.set_xlabel("link angle [deg]")


def responses_figure(small: SmallMotions) -> Figure:
    """Magnitudes of the linear models and the nonlinear rig at small motions, and how far they are apart."""
    with styled():
        figure = new_figure(10.5, 7.4)
        grid = figure.subplots(2, len(_READINGS), squeeze=False, height_ratios=(1.2, 1.0))
        for c, (column, shown) in enumerate(zip(grid.T, _READINGS.values(), strict=True)):
            column[0].set_title(shown.title)
            column[0].set_ylabel(f"magnitude [{shown.per_input} of road]")
            column[1].set_ylabel("difference to the nonlinear rig [%]")
            nonlinear = small.nonlinear[:, c]
            column[0].plot(small.frequency, np.abs(nonlinear), label="nonlinear rig", **_NONLINEAR)
            for (name, response), look in zip(small.models.items(), _STEPS, strict=True):
                away = 100.0 * np.abs(response[:, c] / nonlinear - 1.0)
                column[0].plot(small.frequency, np.abs(response[:, c]), label=printable(name), **look)
                column[1].plot(small.frequency, away, **look)
            for axes in column:
                magnitude_axis(axes)
                frequency_axis(axes, small.frequency[0], small.frequency[-1], labelled=axes is column[-1])
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return figure


def described_figure(test: CamMotions) -> Figure:
    """First harmonics on the cam of the test, nonlinear and with describing functions, and what the elements are."""
    described = test.described
    ends = float(described.frequency[0]), float(described.frequency[-1])
    with styled():
        figure = new_figure(10.5, 7.4)
        upper, lower = figure.subplots(2, len(_READINGS), squeeze=False)
        for c, (axes, shown) in enumerate(zip(upper, _READINGS.values(), strict=True)):
            axes.set_title(shown.title)
            axes.set_ylabel(f"magnitude [{shown.per_input} of road]")
            axes.plot(
                described.frequency,
                np.abs(test.quasi_linear[:, c]),
                label="linear with describing functions",
                **_CURVE,
            )
            axes.plot(described.frequency, np.abs(test.nonlinear[:, c]), label="nonlinear rig", **_NONLINEAR)
            axes.set_ylim(bottom=0.0)
            axes.legend(loc="lower right")
        for axes, values, label in (
            (lower[0], described.damping, "equivalent damping [kN s/m]"),
            (lower[1], described.stiffness, "equivalent stiffness [kN/m]"),
        ):
            for place, (element, look) in enumerate(zip(ELEMENTS, _ELEMENT_LOOKS, strict=True)):
                words = ELEMENT_WORDS[element]
                axes.plot(described.frequency, 1e-3 * values[:, place], label=words, markersize=4.0, **look)
            axes.set_ylabel(label)
            axes.axhline(0.0, color=INK, linewidth=0.6)
            axes.legend()
        for axes in (*upper, *lower):
            frequency_axis(axes, *ends, labelled=axes in lower)
        return figure
