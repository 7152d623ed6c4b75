"""The corner plot: each identified parameter by itself on the diagonal, each pair below it.

Over the draws stands what the curvature at the mode promises (Laplace): a dashed normal density on the diagonal,
and in each pair a cross at the mode whose arms are as long as its 95 % interval. Where the two differ, the
posterior is not normal.
"""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter

from savgs_ident.posterior.result import Marginal, Posterior
from savgs_ident.report.numerals import signed, unit_text
from savgs_ident.report.posterior_density import joint_density, limits_of, region_levels, smooth_density
from savgs_ident.report.style import BLUE, GREY, INK, ORANGE, label_of, new_figure, styled

CONTENTS = (0.95, 0.5)
"""Shares of the draws that the two regions of a pair hold."""

NORMAL_95 = 1.959964
"""Half of the central 95 % interval of a normal distribution [sd]."""

_CELL = 1.6
_MARGIN = 0.92
_END = 0.15


def corner_figure(posterior: Posterior) -> Figure:
    """Marginals and pairs of the identified parameters."""
    shown = posterior.of_role("identified")
    n = len(shown)
    size = _MARGIN + n * _CELL + _END
    with styled():
        figure = new_figure(size, size)
        # Every place is known beforehand: no search for a layout.
        figure.set_layout_engine("none")
        edge, end = _MARGIN / size, 1.0 - _END / size
        places = GridSpec(n, n, left=edge, right=end, bottom=edge, top=end, wspace=0.07, hspace=0.07)
        limits = [limits_of(posterior.draws[each.name], *_promised(each)) for each in shown]
        for row, column in ((down, right) for down in range(n) for right in range(down + 1)):
            axes = figure.add_subplot(places[row, column])
            if column == row:
                _draw_marginal(axes, posterior, shown[row], limits[row])
            else:
                _draw_pair(axes, posterior, (shown[column], shown[row]), (limits[column], limits[row]))
            _label(axes, shown[column], shown[row], row == n - 1, column == 0 and row > 0)
        if n > 1:
            _explain(figure)
        return figure


def name_with_unit(each: Marginal) -> str:
    """The label of an axis along which a parameter runs."""
    return f"{label_of(each.name)} [{label_of(unit_text(each.unit))}]"


def _promised(each: Marginal) -> tuple[float, float]:
    """The 95 % interval of the Laplace approximation."""
    arm = NORMAL_95 * each.laplace_sd
    return each.laplace_value - arm, each.laplace_value + arm


def _draw_marginal(axes: Axes, posterior: Posterior, each: Marginal, limits: tuple[float, float]) -> None:
    points, density = smooth_density(posterior.draws[each.name], limits, each.ess_bulk)
    inside = (points >= each.q025) & (points <= each.q975)
    axes.fill_between(points, density, color=BLUE, alpha=0.12, linewidth=0.0)
    axes.fill_between(points, density, where=inside, color=BLUE, alpha=0.3, linewidth=0.0)
    axes.plot(points, density, color=BLUE, linewidth=1.4)
    axes.axvline(each.median, color=BLUE, linewidth=1.0)
    if each.laplace_sd > 0.0:
        deviation = (points - each.laplace_value) / each.laplace_sd
        normal = np.exp(-0.5 * deviation**2) / (np.sqrt(2.0 * np.pi) * each.laplace_sd)
        axes.plot(points, normal, color=ORANGE, linestyle=(0, (5, 2)), linewidth=1.2)
    axes.set_ylim(bottom=0.0)
    axes.yaxis.set_major_locator(NullLocator())
    axes.set_xlim(*limits)


def _draw_pair(
    axes: Axes,
    posterior: Posterior,
    pair: tuple[Marginal, Marginal],
    limits: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    across, up = (posterior.draws[each.name].ravel() for each in pair)
    x, y, shares = joint_density(across, up, limits, min(each.ess_bulk for each in pair))
    levels = region_levels(shares, CONTENTS)
    if levels[0] < levels[1]:
        tints = [to_rgba(BLUE, 0.2), to_rgba(BLUE, 0.5)]
        axes.contourf(x, y, shares, [*levels, max(float(shares.max()), levels[1]) * 1.01], colors=tints)
        axes.contour(x, y, shares, levels, colors=[BLUE], linewidths=0.9)
    arms = [NORMAL_95 * each.laplace_sd for each in pair]
    modes = [each.laplace_value for each in pair]
    axes.errorbar(modes[0], modes[1], xerr=arms[0], yerr=arms[1], color=ORANGE, elinewidth=1.2, capsize=2.5)
    slope = np.corrcoef(across, up)[0, 1] if np.ptp(across) > 0.0 and np.ptp(up) > 0.0 else np.nan
    if np.isfinite(slope):
        axes.text(
            0.96,
            0.95,
            signed(slope, 2),
            transform=axes.transAxes,
            ha="right",
            va="top",
            color=INK,
            fontsize=8.5,
        )
    axes.set_xlim(*limits[0])
    axes.set_ylim(*limits[1])
    axes.yaxis.set_major_locator(MaxNLocator(4, prune="both"))


def _label(axes: Axes, across: Marginal, up: Marginal, lowest: bool, first: bool) -> None:
    """Numbers and names on the outer axes only."""
    axes.xaxis.set_major_locator(MaxNLocator(4, prune="both"))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ScalarFormatter(useOffset=False))
    axes.tick_params(axis="x", labelbottom=lowest, rotation=40, labelsize=8.0, color=GREY)
    axes.tick_params(axis="y", labelleft=first, labelsize=8.0, color=GREY)
    far = 0.13 - _MARGIN / _CELL
    if lowest:
        axes.set_xlabel(name_with_unit(across), va="bottom")
        axes.xaxis.set_label_coords(0.5, far - 0.1)
    if first:
        axes.set_ylabel(name_with_unit(up))
        axes.yaxis.set_label_coords(far, 0.5)


def _explain(figure: Figure) -> None:
    """What the marks mean, in the empty corner."""
    marks: list[Artist] = [
        Patch(facecolor=to_rgba(BLUE, 0.5), edgecolor=BLUE, label="50 % of the draws"),
        Patch(facecolor=to_rgba(BLUE, 0.2), edgecolor=BLUE, label="95 % of the draws"),
        Line2D([], [], color=BLUE, linewidth=1.0, label="median"),
        Line2D([], [], color=ORANGE, linestyle=(0, (5, 2)), linewidth=1.2, label="Laplace"),
    ]
    figure.legend(handles=marks, loc="upper right", fontsize=8.5)
