"""Where the gap is: one cell for each dwell and harmonic order of a channel, after recalibration.

Above in noise standard deviations (is it there?), below in per cent of the channel's response (does it matter?). The
steps of the colour are named beside it, so that a cell can be read; it darkens steadily, so that it can be read in
grey too. What lies within the noise is white, what was not measured is crossed out.
"""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from savgs_ident.diagnose.result import Diagnosis, MapCell
from savgs_ident.report.readings import READINGS
from savgs_ident.report.style import GREY, PALE, label_of, new_figure, styled

NOISE = 2.0
"""Up to so many standard deviations a gap is white: it lies within the noise."""

_ROUND = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4)
_STEPS = 6
_LEAST_SIGMA, _LEAST_PERCENT = 100.0, 10.0

_TICK_GAP = 3


def gap_channels(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The channels in the map, in their order there."""
    return tuple(dict.fromkeys(cell.channel for cell in diagnosis.map))


def gap_table(
    cells: Sequence[MapCell], channel: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz] (F,), orders (K,), and the gap in sd and in per cent, (K, F); NaN where there is none."""
    own = [cell for cell in cells if cell.channel == channel]
    frequency = np.array(sorted({cell.frequency_hz for cell in own}))
    orders = np.array(sorted({cell.order for cell in own}), dtype=np.int64)
    sigma, percent = (np.full((orders.size, frequency.size), np.nan) for _ in range(2))
    for cell in own:
        place = (np.searchsorted(orders, cell.order), np.searchsorted(frequency, cell.frequency_hz))
        sigma[place], percent[place] = cell.gap_sigma, cell.gap_percent
    return frequency, orders, sigma, percent


def gap_map_figure(diagnosis: Diagnosis, channel: str) -> Figure:
    """The map of one channel."""
    frequency, orders, sigma, percent = gap_table(diagnosis.map, channel)
    title = READINGS[channel].title if channel in READINGS else channel
    with styled():
        figure = new_figure(4.5, 5.4)
        figure.set_layout_engine("none")
        places = {"left": 0.115, "right": 0.86, "bottom": 0.092, "top": 0.9, "hspace": 0.18}
        above, below = figure.subplots(2, 1, gridspec_kw=places)
        figure.suptitle(label_of(title), y=0.985, fontsize=10.0, fontweight="bold")
        _draw(above, frequency, orders, sigma, colour_steps(sigma, NOISE, _LEAST_SIGMA), "gap [noise sd]")
        _draw(
            below,
            frequency,
            orders,
            percent,
            colour_steps(percent, _ROUND[0], _LEAST_PERCENT),
            "gap [% of the response]",
        )
        above.tick_params(axis="x", labelbottom=False)
        below.set_xlabel("road frequency of the dwell [Hz]")
        return figure


def colour_steps(values: NDArray[np.float64], first: float, least: float) -> tuple[float, ...]:
    """Where the colour changes: at 0, at ``first``, then at round numbers up to the largest value.

    The scale reaches ``least`` at least, so that a small gap looks small; the last step has no end. Values
    of any shape and any unit, and the steps in the same unit.
    """
    largest = max(float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0)), least)
    beyond = [step for step in _ROUND if first < step <= largest]
    chosen = np.unique(np.linspace(0, len(beyond) - 1, _STEPS).round().astype(int))
    return (0.0, first, *(beyond[place] for place in chosen))


def _draw(
    axes: Axes,
    frequency: NDArray[np.float64],
    orders: NDArray[np.int64],
    values: NDArray[np.float64],
    steps: Sequence[float],
    label: str,
) -> None:
    palette = matplotlib.colormaps["magma_r"](np.linspace(0.08, 0.95, len(steps) - 1))
    colours = ListedColormap([(1.0, 1.0, 1.0, 1.0), *palette])
    axes.set_facecolor("white")
    axes.grid(visible=False)
    _cross_out(axes, np.isnan(values))
    edges_x, edges_y = np.arange(frequency.size + 1) - 0.5, np.arange(orders.size + 1) - 0.5
    mesh = axes.pcolormesh(
        edges_x,
        edges_y,
        np.ma.masked_invalid(np.abs(values)),
        cmap=colours,
        norm=BoundaryNorm(steps, len(steps), extend="max"),
        edgecolors=PALE,
        linewidth=0.3,
    )
    bar = axes.figure.colorbar(mesh, ax=axes, extend="max", extendfrac=0.09, pad=0.025, fraction=0.06)
    bar.set_ticks(list(steps), labels=[f"{step:g}" for step in steps])
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.tick_params(length=0.0)
    bar.outline.set_linewidth(0.6)
    axes.set_title(label, loc="left", fontsize=9.0, fontweight="normal")
    axes.set_ylabel("harmonic order")
    axes.yaxis.set_major_locator(FixedLocator(list(range(orders.size))))
    axes.set_yticklabels([str(order) for order in orders])
    ticks = _ticks(frequency)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.set_xticklabels([f"{frequency[tick]:.3g}" for tick in ticks])
    axes.tick_params(length=2.5)


def _cross_out(axes: Axes, absent: NDArray[np.bool_]) -> None:
    """A small cross where nothing was measured."""
    rows, columns = np.nonzero(absent)
    axes.scatter(columns, rows, marker="x", s=9, linewidths=0.6, color=GREY, zorder=3)


def _ticks(frequency: NDArray[np.float64]) -> list[int]:
    """Every third dwell and the last, all if there are few."""
    last = frequency.size - 1
    if last < 3 * _TICK_GAP:
        return list(range(last + 1))
    kept = [tick for tick in range(0, last, _TICK_GAP) if last - tick >= _TICK_GAP - 1]
    return [*kept, last]
