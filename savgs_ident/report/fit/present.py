"""The presenter of a fit, and of a model against a measurement; what draws is loaded when something is drawn."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from savgs_ident.core.output import write_json
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.report.presenters import AbstractPresenter, Figures, Shown, is_quarter_car

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from savgs_ident.fit.comparison import Comparison
    from savgs_ident.fit.result import Fit


class _Identified(AbstractPresenter[Shown]):
    """A model drawn against a measurement: smooth curves, for which it is solved between the dwells too."""

    @abstractmethod
    def comparison(self, result: Shown) -> "Comparison":
        """The model against the measurement."""

    def figures(self, result: Shown) -> Figures:
        return {"bode": lambda: comparison_figure(self.comparison(result))}

    def write(self, result: Shown, folder: Path, progress: Progress) -> Iterator[Path]:
        yield write_json(folder / f"{self.stem}.json", self.record(result))
        yield from self.more(result, folder)
        yield from draw_comparison(self.comparison(result), folder, progress)


class _Fit(_Identified["Fit"]):
    stem = "fit"

    def record(self, result: "Fit") -> Mapping[str, Any]:
        from savgs_ident.report.fit.record import fit_record

        return fit_record(result)

    def text(self, result: "Fit") -> RenderableType:
        from savgs_ident.report.fit.text import fit_text

        return fit_text(result)

    def doubts(self, result: "Fit") -> tuple[str, ...]:
        if result.trusted:
            return ()
        if not result.status.ok:
            return (f"{result.status.advice}.",)
        if not all(status.ok for status in result.dwell_status):
            return ("the model's periodic motion was not found in every dwell.",)
        if not result.verdict.explained:
            return ("the model does not explain the data: look for what is missing with `diagnose`.",)
        return ("the data do not identify every free parameter.",)

    def comparison(self, result: "Fit") -> "Comparison":
        from savgs_ident.fit.comparison import comparison_of

        return comparison_of(result)

    def more(self, result: "Fit", folder: Path) -> Iterator[Path]:
        if not is_quarter_car(result.estimated):
            return
        from savgs_ident.plants.quarter_car.rig import write_rig

        write_rig(result.model.rig, folder / "model.toml")
        yield folder / "model.toml"


class _Comparison(_Identified["Comparison"]):
    stem = "bode"

    def record(self, result: "Comparison") -> Mapping[str, Any]:
        from savgs_ident.report.fit.record import bode_record

        return bode_record(result)

    def text(self, result: "Comparison") -> RenderableType:
        from savgs_ident.report.fit.text import bode_text

        return bode_text(dict(self.record(result)), result.given)

    def doubts(self, result: "Comparison") -> tuple[str, ...]:
        return () if result.trusted else ("the model's periodic motion was not found in every dwell.",)

    def comparison(self, result: "Comparison") -> "Comparison":
        return result


def draw_comparison(comparison: "Comparison", folder: Path, progress: Progress) -> tuple[Path, ...]:
    """Write bode.png and bode.pdf of a model against a measurement."""
    figure = comparison_figure(comparison, progress)
    from savgs_ident.report.theme import write_figure

    return write_figure(folder, "bode", figure)


def comparison_figure(comparison: "Comparison", progress: Progress = no_progress) -> "Figure":
    """The Bode figure of a model against a measurement, with the model solved between the dwells."""
    progress("solving the model between the dwells")
    # Loading what draws takes as long as solving, which leaves Python free.
    with ThreadPoolExecutor(1) as pool:
        solving = pool.submit(comparison.between)
        from savgs_ident.fit.residuals import measured_points, whitened
        from savgs_ident.report.fit.bode import bode_figure
        from savgs_ident.report.text import channel_labels
    model, frictionless = solving.result()
    given, measured = comparison.given, comparison.measured
    curves = [model.curve("model as drawn" if given.is_drawing else "identified model")]
    if comparison.effects:
        curves.append(frictionless.curve("the same without effects"))
    progress("drawing")
    labels, driven = channel_labels(given), given.plant.inputs[0].name
    points = measured_points(measured, tuple(labels), driven)
    residuals = whitened(measured, tuple(labels), comparison.model.harmonics, comparison.used)
    title = f"Model and measurement: {Path(comparison.origin.data).name or given.plant_name}"
    return bode_figure(title, points, curves, residuals, tuple(labels.values()))


FIT = _Fit()
COMPARISON = _Comparison()
