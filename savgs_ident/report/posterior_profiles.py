"""Profile likelihood of one parameter against its marginal and the Laplace parabola.

All three are drawn as the rise of -2 log density above its minimum, so that a normal posterior is the same
parabola three times. A profile that stays low to one side says that the data do not bound the parameter there; a
marginal that is narrower than the profile, that other parameters' room was averaged and not optimised.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from savgs_ident.posterior.result import Marginal, Posterior, ProfileLine
from savgs_ident.report.numerals import MINUS
from savgs_ident.report.posterior_corner import name_with_unit
from savgs_ident.report.posterior_density import limits_of, smooth_density
from savgs_ident.report.style import BLUE, GREY, INK, ORANGE, new_figure, styled

THRESHOLDS = ((1.0, "68 %"), (3.841, "95 %"))
"""Rises at which an interval of this confidence ends, for one parameter of a normal posterior."""

_HIGHEST = 9.0


def profile_figure(posterior: Posterior, each: Marginal, profile: ProfileLine) -> Figure:
    """Profile, marginal and Laplace parabola of one parameter."""
    limits = limits_of(posterior.draws[each.name], float(profile.values[0]), float(profile.values[-1]))
    with styled():
        figure = new_figure(4.5, 3.3)
        figure.set_layout_engine("none")
        axes = figure.subplots(1, 1, gridspec_kw={"left": 0.13, "right": 0.97, "bottom": 0.17, "top": 0.86})
        _draw_thresholds(axes)
        points, density = smooth_density(posterior.draws[each.name], limits, each.ess_bulk)
        known = density > np.exp(-0.5 * _HIGHEST) * density.max()
        rise = np.where(known, -2.0 * np.log(np.where(known, density / density.max(), 1.0)), np.nan)
        axes.plot(points, rise, color=GREY, linestyle=(0, (1, 1.2)), linewidth=2.2, label="marginal")
        if each.laplace_sd > 0.0:
            parabola = ((points - each.laplace_value) / each.laplace_sd) ** 2
            axes.plot(points, parabola, color=ORANGE, linestyle=(0, (5, 2)), linewidth=1.3, label="Laplace")
        axes.plot(
            profile.values,
            profile.rise,
            color=BLUE,
            marker="o",
            markersize=3.5,
            markerfacecolor="white",
            label="profile",
        )
        axes.set_xlim(*limits)
        axes.set_ylim(0.0, _HIGHEST)
        axes.set_xlabel(name_with_unit(each))
        axes.set_ylabel(f"rise of {MINUS}2 log density [1]")
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.xaxis.set_major_formatter(ScalarFormatter(useOffset=False))
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles[::-1], labels[::-1], loc="upper center", ncols=3)
        return figure


def _draw_thresholds(axes: Axes) -> None:
    for height, label in THRESHOLDS:
        axes.axhline(height, color=INK, linewidth=0.7)
        axes.text(
            0.99, height, label, transform=axes.get_yaxis_transform(), ha="right", va="bottom", fontsize=8.0
        )
