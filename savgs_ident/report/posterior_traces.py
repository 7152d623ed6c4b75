"""Traces and ranks of the chains of one parameter: do all chains tell the same?

Above, the draws of up to eight chains in their order. Below, a row for every chain and a column for every tenth
of the pooled draws in order of size: how many more or fewer of the chain's draws fall there than in a chain like
all others, in standard deviations of chance (the rank plot of Vehtari, Gelman, Simpson, Carpenter and Bürkner,
Rank-normalization, folding, and localization, Bayesian Analysis 16, 2021, drawn as a map, so that it holds a
hundred walkers as well as four chains). A pale map is a good one.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from numpy.typing import NDArray
from scipy.stats import rankdata

from savgs_ident.posterior.result import Marginal, Posterior
from savgs_ident.report.posterior_corner import name_with_unit
from savgs_ident.report.style import BLUE, GREY, INK, ORANGE, PALE, new_figure, styled

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
