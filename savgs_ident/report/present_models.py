"""The presenters of models by themselves: simulated, exported, linearised, with a controller, in a closed loop.

What draws is loaded when something is drawn.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from savgs_ident.core.files import write_json, write_table
from savgs_ident.core.presentation import Origin, Progress, Result
from savgs_ident.report.presenters import AbstractPresenter, Figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from savgs_ident.control.closed_loop.study import LoopStudy
    from savgs_ident.control.design import Design
    from savgs_ident.control.linear_study import LinearStudy
    from savgs_ident.core.values import Values
    from savgs_ident.export.public import Exported
    from savgs_ident.simulate.public import SimulatedResponse, SimulatedSweep

_UNSOLVED = "the simulation did not converge everywhere; see the status in the table."


class _SimulatedResponse(AbstractPresenter["SimulatedResponse"]):
    stem = "simulate"

    def record(self, result: "SimulatedResponse") -> Mapping[str, Any]:
        from savgs_ident.report.model import response_record

        return response_record(result)

    def text(self, result: "SimulatedResponse") -> RenderableType:
        from savgs_ident.report.model import response_text

        return response_text(result)

    def doubts(self, result: "SimulatedResponse") -> tuple[str, ...]:
        return result.model.doubts if result.trusted else (*result.model.doubts, _UNSOLVED)

    def figures(self, result: "SimulatedResponse") -> Figures:
        from savgs_ident.report.bode import response_figure
        from savgs_ident.report.text import channel_labels

        effects, labels = result.origin.effects, tuple(channel_labels(result.model).values())
        curve = result.curve("with " + ", ".join(effects) if effects else "without effects")
        return {"simulate": lambda: response_figure("Simulated response", [curve], labels)}

    def more(self, result: "SimulatedResponse", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.model import response_columns

        yield write_table(folder / "simulate.csv", response_columns(result))


class _SimulatedSweep(AbstractPresenter["SimulatedSweep"]):
    stem = "simulate"

    def record(self, result: "SimulatedSweep") -> Mapping[str, Any]:
        from savgs_ident.report.model import sweep_record

        return sweep_record(result)

    def text(self, result: "SimulatedSweep") -> RenderableType:
        from savgs_ident.report.model import sweep_text

        return sweep_text(result)

    def doubts(self, result: "SimulatedSweep") -> tuple[str, ...]:
        return result.model.doubts if result.trusted else (*result.model.doubts, _UNSOLVED)

    def figures(self, result: "SimulatedSweep") -> Figures:
        from savgs_ident.report.model import sweep_figure

        return {"simulate": lambda: sweep_figure(result)}

    def more(self, result: "SimulatedSweep", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.model import sweep_columns

        yield write_table(folder / "simulate.csv", sweep_columns(result))


class _Exported(AbstractPresenter["Exported"]):
    stem = "export"

    def record(self, result: "Exported") -> Mapping[str, Any]:
        from savgs_ident.report.model import export_record

        return export_record(result.gathered, result.written, control_origin(result))

    def text(self, result: "Exported") -> RenderableType:
        from savgs_ident.report.model import export_text

        return export_text(self.record(result))

    def doubts(self, result: "Exported") -> tuple[str, ...]:
        doubts: tuple[str, ...] = result.gathered.doubts
        return doubts

    def write(self, result: "Exported", folder: Path, progress: Progress) -> Iterator[Path]:
        del progress
        yield write_json(folder / "export.json", self.record(result))


SIMULATED_RESPONSE = _SimulatedResponse()
SIMULATED_SWEEP = _SimulatedSweep()
EXPORTED = _Exported()


_CONTROL_PACKAGES = ("jax", "numpy", "scipy", "control", "slycot")
"""Whose version matters to linear models and controllers."""


def control_origin(result: Result) -> Origin:
    """Where a result comes from, with the versions of what computed it."""
    return result.origin.with_versions(_CONTROL_PACKAGES)


class _LinearStudy(AbstractPresenter["LinearStudy"]):
    stem = "linearise"

    def record(self, result: "LinearStudy") -> Mapping[str, Any]:
        from savgs_ident.report.control.linear_text import linear_record

        return linear_record(result, control_origin(result))

    def text(self, result: "LinearStudy") -> RenderableType:
        from savgs_ident.report.control.linear_text import linear_text

        return linear_text(self.record(result))

    def doubts(self, result: "LinearStudy") -> tuple[str, ...]:
        from savgs_ident.report.control.linear_text import alarm

        return result.model.doubts if result.trusted else (*result.model.doubts, alarm(result))

    def page(self, result: "LinearStudy") -> str:
        from savgs_ident.report.control.linear_page import linear_html

        return linear_html(result, control_origin(result))

    def figures(self, result: "LinearStudy") -> Figures:
        from savgs_ident.report.control.linear_page import alpha_figure, described_figure, responses_figure

        figures: dict[str, Callable[[], Figure]] = {
            "alpha": lambda: alpha_figure(result.equivalents),
            "responses": lambda: responses_figure(result.small),
        }
        test = result.at_test
        return figures if test is None else figures | {"described": lambda: described_figure(test)}


class _Design(AbstractPresenter["Design"]):
    stem = "design"

    def record(self, result: "Design") -> Mapping[str, Any]:
        from savgs_ident.report.control.design_text import design_record

        return design_record(result, control_origin(result))

    def text(self, result: "Design") -> RenderableType:
        from savgs_ident.report.control.design_text import design_text

        return design_text(self.record(result))

    def doubts(self, result: "Design") -> tuple[str, ...]:
        from savgs_ident.report.control.design_text import alarm

        return result.model.doubts if result.trusted else (*result.model.doubts, alarm(result))

    def page(self, result: "Design") -> str:
        from savgs_ident.report.control.design_page import design_html

        return design_html(result, control_origin(result))

    def figures(self, result: "Design") -> Figures:
        from savgs_ident.report.control import design_figures

        return {
            "gamma": lambda: design_figures.gamma_figure(result),
            "loop": lambda: design_figures.sensitivity_figure(result),
            "ride": lambda: design_figures.ride_figure(result),
            "robustness": lambda: design_figures.robustness_figure(result),
            "regularisation": lambda: design_figures.regularisation_figure(result),
        }

    def write(self, result: "Design", folder: Path, progress: Progress) -> Iterator[Path]:
        from savgs_ident.control.design import controller_record

        yield write_json(folder / "controller.json", controller_record(result.digital))
        yield from super().write(result, folder, progress)


class _LoopStudy(AbstractPresenter["LoopStudy"]):
    stem = "closed-loop"

    def record(self, result: "LoopStudy") -> Mapping[str, Any]:
        from savgs_ident.report.control.loop_text import loop_record

        return loop_record(result, control_origin(result), result.controller)

    def text(self, result: "LoopStudy") -> RenderableType:
        from savgs_ident.report.control.loop_text import loop_text

        return loop_text(result)

    def doubts(self, result: "LoopStudy") -> tuple[str, ...]:
        from savgs_ident.report.control.loop_text import alarm

        return result.model.doubts if result.trusted else (*result.model.doubts, alarm(result))

    def page(self, result: "LoopStudy") -> str:
        from savgs_ident.report.control.loop_page import loop_html

        return loop_html(result, _values(result), control_origin(result), result.controller)

    def figures(self, result: "LoopStudy") -> Figures:
        from savgs_ident.report.control import loop_page

        figures: dict[str, Callable[[], Figure]] = {
            "closed-loop": lambda: loop_page.loop_signals_figure(result, _values(result)),
            "failures": lambda: loop_page.failures_figure(result),
        }
        if result.on_rigs:
            figures["rigs"] = lambda: loop_page.rigs_figure(result)
        if result.causes:
            figures["causes"] = lambda: loop_page.causes_figure(result)
        return figures

    def more(self, result: "LoopStudy", folder: Path) -> Iterator[Path]:
        from savgs_ident.report.control.loop_text import loop_columns

        yield write_table(folder / "closed-loop.csv", loop_columns(result))


def _values(study: "LoopStudy") -> "Values":
    """The parameters of the model that was run."""
    from savgs_ident.core.values import as_values

    return as_values(study.model.table.as_dict())


LINEAR_STUDY = _LinearStudy()
DESIGN = _Design()
LOOP_STUDY = _LoopStudy()
