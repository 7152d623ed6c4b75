"""Pictures of blind trials: which verdict each truth got, and how often what is stated is true."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from savgs_ident.report.text import decimal
from savgs_ident.report.theme import BLUE, GREY, INK, ORANGE, new_figure, printable, styled
from savgs_ident.validation.blind_rates import (
    LEFT_ALONE,
    Reliability,
    confusion_of,
    reliability_by_level,
    reliability_of,
)
from savgs_ident.validation.blind_score import Level, Score
from savgs_ident.validation.foreign_laws import TRIAL_EFFECTS

_RIGHT = LinearSegmentedColormap.from_list("right", ["#dbe8f4", BLUE])
_WRONG = LinearSegmentedColormap.from_list("wrong", ["#fbe3d3", ORANGE])
_CELL = 0.27
"""Size of a cell [inch]."""


def confusion_figure(scores: Sequence[Score]) -> Figure:
    """Truths down, verdicts across; blue is right, orange is not, the number says how many trials."""
    confusion = confusion_of(scores, TRIAL_EFFECTS)
    truths, verdicts, counts = confusion.truths, confusion.verdicts, confusion.counts
    most = max(int(counts.max(initial=1)), 1)
    with styled():
        figure = new_figure(2.9 + _CELL * len(verdicts), 2.6 + _CELL * len(truths))
        axes = figure.subplots()
        axes.grid(visible=False)
        for row, truth in enumerate(truths):
            for column, verdict in enumerate(verdicts):
                count = int(counts[row, column])
                if count == 0:
                    if verdict == truth:
                        axes.plot(column, row, ".", color=GREY, markersize=3)
                    continue
                right = verdict in (truth, LEFT_ALONE)
                shade = (_RIGHT if right else _WRONG)(count / most)
                axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, color=shade, linewidth=0.0))
                dark = count > 0.6 * most and right
                axes.text(column, row, str(count), ha="center", va="center", color="white" if dark else INK)
        axes.set_xticks(range(len(verdicts)), [printable(name) for name in verdicts], rotation=90)
        axes.set_yticks(range(len(truths)), [printable(name) for name in truths])
        axes.set_xlim(-0.5, len(verdicts) - 0.5)
        axes.set_ylim(len(truths) - 0.5, -0.5)
        axes.set_aspect("equal")
        axes.tick_params(length=0)
        axes.set_xlabel("verdict")
        axes.set_ylabel("truth")
        axes.set_title(f"{len(scores)} blind trials", loc="left")
    return figure


def reliability_figure(scores: Sequence[Score]) -> Figure:
    """Stated probabilities across, how often what was said is true up, with 95 % intervals; the diagonal is ideal.

    Of whole verdicts, and of what they say of ports, families and laws.
    """
    levels = {LEVEL_WORDS[level]: each for level, each in reliability_by_level(scores).items()}
    parts = {"verdicts": reliability_of(scores)} | levels
    with styled():
        columns = min(len(parts), 2)
        figure = new_figure(4.4 * columns, 4.4 * -(-len(parts) // columns))
        for place, (words, each) in enumerate(parts.items()):
            axes = figure.add_subplot(-(-len(parts) // columns), columns, place + 1)
            _draw_reliability(axes, each, words)
    return figure


LEVEL_WORDS: Mapping[Level, str] = {"port": "ports", "family": "families", "law": "laws"}
"""What is counted on a level."""


def _draw_reliability(axes: Axes, reliability: Reliability, words: str) -> None:
    axes.plot([0.0, 1.0], [0.0, 1.0], color=INK, linestyle="--", linewidth=0.8, label="ideal")
    for place, each in enumerate(reliability.bins):
        low, share, high = each.rate.low, each.rate.rate, each.rate.high
        if each.stated is None or share is None:
            continue
        ends = [[share - low], [high - share]]
        axes.errorbar(each.stated, share, yerr=ends, color=BLUE, marker="o", capsize=2.5, linestyle="none")
        # Neighbours are near each other where probabilities are high: above and below in turn.
        end, offset, side = (low, -3.0, "top") if place % 2 else (high, 3.0, "bottom")
        axes.annotate(
            str(each.rate.total),
            (each.stated, end),
            (0.0, offset),
            textcoords="offset points",
            ha="center",
            va=side,
        )
    axes.set_xlim(-0.05, 1.05)
    axes.set_ylim(0.0, 1.1)
    axes.set_aspect("equal")
    axes.set_xlabel("stated probability [1]")
    axes.set_ylabel(f"share of {words} that are true [1]")
    error = "" if reliability.error is None else f", calibration error {decimal(reliability.error, 3)}"
    stated = sum(each.rate.total for each in reliability.bins)
    axes.set_title(f"{stated} {words}{error}", loc="left")
    axes.legend(loc="upper left")
