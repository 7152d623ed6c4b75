"""Who is taken for whom: the confusion matrix as a picture."""

from collections.abc import Sequence

from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from savgs_ident.diagnose.blind.score import Score
from savgs_ident.diagnose.blind.totals import confusion_of
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.report.style import BLUE, GREY, INK, ORANGE, label_of, new_figure, styled

_RIGHT = LinearSegmentedColormap.from_list("right", ["#dbe8f4", BLUE])
_WRONG = LinearSegmentedColormap.from_list("wrong", ["#fbe3d3", ORANGE])
_CELL = 0.27
"""Size of a cell [inch]."""


def confusion_figure(scores: Sequence[Score]) -> Figure:
    """Truths down, verdicts across; blue is right, orange is not, the number says how many trials."""
    confusion = confusion_of(scores, tuple(CATALOGUE))
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
                    if truth == verdict:
                        axes.plot(column, row, ".", color=GREY, markersize=3)
                    continue
                shade = (_RIGHT if truth == verdict else _WRONG)(count / most)
                axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, color=shade, linewidth=0.0))
                dark = count > 0.6 * most and truth == verdict
                axes.text(column, row, str(count), ha="center", va="center", color="white" if dark else INK)
        axes.set_xticks(range(len(verdicts)), [label_of(name) for name in verdicts], rotation=90)
        axes.set_yticks(range(len(truths)), [label_of(name) for name in truths])
        axes.set_xlim(-0.5, len(verdicts) - 0.5)
        axes.set_ylim(len(truths) - 0.5, -0.5)
        axes.set_aspect("equal")
        axes.tick_params(length=0)
        axes.set_xlabel("the verdict")
        axes.set_ylabel("what there was")
        axes.set_title(f"{len(scores)} blind trials", loc="left")
    return figure
