"""Figures of a posterior: corner plot, profile likelihoods, traces and ranks of the chains.

The corner plot shows each identified parameter on the diagonal and each pair below it; dashed and crossed is the
normal approximation at the mode (Laplace). Where the two differ, the posterior is not normal. A density is a fine
histogram smoothed by a normal kernel whose width follows Silverman's rule for the effective number of draws.

Profile, marginal and Laplace parabola are drawn as the rise of -2 log density above its minimum, so that a normal
posterior is the same parabola three times. A profile that stays low to one side means that the data do not bound the
parameter there.

The rank map has a row for every chain and a column for every tenth of the pooled draws in order of size: the excess
of the chain's draws there, in standard deviations (the rank plot of Vehtari, Gelman, Simpson, Carpenter and Bürkner,
Rank-normalization, folding, and localization, Bayesian Analysis 16, 2021, drawn as a map, so that it holds a hundred
walkers as well as four chains). A pale map is a good one.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d
from scipy.stats import rankdata

from savgs_ident.inference.result import Marginal, Posterior, ProfileLine
from savgs_ident.report.text import MINUS, signed, unit_text
from savgs_ident.report.theme import BLUE, GREY, INK, ORANGE, PALE, new_figure, printable, styled

_FINE = 240
_COARSE = 90


def axis_limits(draws: NDArray[np.float64], *others: float) -> tuple[float, float]:
    """Limits of an axis that shows nearly all ``draws`` and every one of ``others`` that is finite.

    ``draws`` (n,) and limits are in the same unit.
    """
    inner = np.quantile(draws, (0.002, 0.998))
    known = [value for value in others if np.isfinite(value)]
    low, high = min(float(inner[0]), *known, np.inf), max(float(inner[1]), *known, -np.inf)
    # A chain that never moved has no width of its own.
    room = 0.1 * (high - low) or 1e-3 * abs(high) or 1.0
    return low - room, high + room


def smooth_density(
    draws: NDArray[np.float64], limits: tuple[float, float], effective: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n,) between ``limits`` and the density there [1/unit], (n,); its area is 1.

    ``effective`` is how many independent draws the correlated ones are worth.
    """
    counts, edges = np.histogram(draws, bins=_FINE, range=limits)
    step = (limits[1] - limits[0]) / _FINE
    width = 1.06 * float(np.std(draws)) * _worth(draws, effective) ** -0.2 / step
    smooth = gaussian_filter1d(counts.astype(np.float64), max(width, 0.5), mode="constant")
    return 0.5 * (edges[1:] + edges[:-1]), smooth / (np.sum(smooth) * step)


def joint_density(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    limits: tuple[tuple[float, float], tuple[float, float]],
    effective: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Points on x (n,) and on y (n,), and the share of the draws around each pair, (n, n), rows along y."""
    counts, along_x, along_y = np.histogram2d(x, y, bins=_COARSE, range=limits)
    steps = [(high - low) / _COARSE for low, high in limits]
    narrow = _worth(x, effective) ** (-1.0 / 6.0)
    widths = [max(float(np.std(v)) * narrow / step, 0.5) for v, step in zip((x, y), steps, strict=True)]
    smooth = gaussian_filter(counts, widths, mode="constant")
    centres = [0.5 * (edges[1:] + edges[:-1]) for edges in (along_x, along_y)]
    return centres[0], centres[1], smooth.T / np.sum(smooth)


def region_levels(shares: NDArray[np.float64], contents: Sequence[float]) -> list[float]:
    """Heights above which the densest regions hold these ``contents`` of all draws, in increasing order.

    ``shares`` of the draws are of any shape.
    """
    falling = np.sort(shares.ravel())[::-1]
    held = np.cumsum(falling)
    levels = [falling[min(int(np.searchsorted(held, content)), held.size - 1)] for content in contents]
    return sorted(float(level) for level in levels)


def _worth(draws: NDArray[np.float64], effective: float) -> float:
    return float(np.clip(effective, 10.0, draws.size)) if np.isfinite(effective) else 10.0


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
        limits = [axis_limits(posterior.draws[each.name], *_promised(each)) for each in shown]
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
    return f"{printable(each.name)} [{printable(unit_text(each.unit))}]"


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
        # In the corner that a region with this slope leaves free.
        at, side = (0.04, "left") if slope > 0.0 else (0.96, "right")
        axes.text(
            at, 0.95, signed(slope, 2), transform=axes.transAxes, ha=side, va="top", color=INK, fontsize=8.5
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


THRESHOLDS = ((1.0, "68 %"), (3.841, "95 %"))
"""Rises at which an interval of this confidence ends, for one parameter of a normal posterior."""

_HIGHEST = 9.0


def profile_figure(posterior: Posterior, each: Marginal, profile: ProfileLine) -> Figure:
    """Profile, marginal and Laplace parabola of one parameter."""
    limits = axis_limits(posterior.draws[each.name], float(profile.values[0]), float(profile.values[-1]))
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
        axes.xaxis.set_major_locator(MaxNLocator(5, prune="upper"))
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


MOST_TRACES = 8
"""How many chains have their trace drawn."""

SURPLUS_SHOWN = 5.0
"""Where the colours of the rank map end [sd]."""

_TENTHS = 10
_LEAST_WORTH = 20.0
_POINTS = 500
_COLOURS = (BLUE, ORANGE, GREY, INK)
_MAP = LinearSegmentedColormap.from_list("surplus", [BLUE, "#ffffff", ORANGE])


def trace_figure(posterior: Posterior, each: Marginal) -> Figure:
    """Trace and rank map of one parameter."""
    draws = posterior.draws[each.name]
    with styled():
        figure = new_figure(4.5, 3.5)
        figure.set_layout_engine("none")
        places = {"left": 0.19, "right": 0.97, "bottom": 0.14, "top": 0.96, "hspace": 0.5}
        trace, ranks = figure.subplots(2, 1, height_ratios=(1.6, 1.0), gridspec_kw=places)
        _draw_traces(trace, draws, each)
        _draw_ranks(ranks, rank_surplus(draws, each.autocorrelation))
        for axes in (trace, ranks):
            axes.yaxis.set_label_coords(-0.185, 0.5)
        return figure


def rank_surplus(draws: NDArray[np.float64], autocorrelation: float) -> NDArray[np.float64]:
    """Surplus of draws of each chain in each tenth of the pooled draws [sd of chance], (chains, 10).

    Chance is that of as many independent draws as a chain is worth by its autocorrelation time [draws], but at
    least of twenty: chains that disagree make any estimate of their worth too small.
    """
    chains, length = draws.shape
    share = 1.0 / _TENTHS
    tenth = np.minimum((rankdata(draws.ravel()) - 0.5) / draws.size * _TENTHS, _TENTHS - 1).astype(np.int64)
    place = np.repeat(np.arange(chains), length) * _TENTHS + tenth
    found = np.bincount(place, minlength=chains * _TENTHS).reshape(chains, _TENTHS) / length
    worth = (
        max(length / max(autocorrelation, 1.0), _LEAST_WORTH)
        if np.isfinite(autocorrelation)
        else _LEAST_WORTH
    )
    return np.asarray((found - share) / np.sqrt(share * (1.0 - share) / worth))


def _draw_traces(axes: Axes, draws: NDArray[np.float64], each: Marginal) -> None:
    chains, length = draws.shape
    chosen = np.unique(np.linspace(0, chains - 1, min(chains, MOST_TRACES)).round().astype(np.int64))
    kept = np.arange(0, length, max(length // _POINTS, 1))
    axes.axhspan(each.q025, each.q975, color=PALE, alpha=0.5, linewidth=0.0, zorder=0)
    for at, chain in enumerate(chosen):
        colour = _COLOURS[at % len(_COLOURS)]
        axes.plot(kept, draws[chain, kept], color=colour, linewidth=0.5, alpha=0.75, rasterized=True)
    axes.axhline(each.median, color=INK, linewidth=0.8)
    axes.set_xlim(0, max(length - 1, 1))
    axes.set_xlabel("draw")
    axes.set_ylabel(name_with_unit(each))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))


def _draw_ranks(axes: Axes, surplus: NDArray[np.float64]) -> None:
    chains = surplus.shape[0]
    axes.imshow(
        surplus,
        cmap=_MAP,
        vmin=-SURPLUS_SHOWN,
        vmax=SURPLUS_SHOWN,
        aspect="auto",
        interpolation="nearest",
        extent=(0.0, 100.0, chains + 0.5, 0.5),
    )
    axes.grid(False)
    axes.set_xlabel("rank among all draws [%]")
    axes.set_ylabel("chain")
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)
