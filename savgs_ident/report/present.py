"""The presenter of simulated motions and exported models; what draws is loaded when something is drawn."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from savgs_ident.core.output import write_json, write_table
from savgs_ident.core.presentation import Progress
from savgs_ident.report.control.present import control_origin
from savgs_ident.report.presenters import AbstractPresenter, Figures

if TYPE_CHECKING:
    from savgs_ident.export.public import Exported
    from savgs_ident.simulate.frequency_response import SimulatedResponse, SimulatedSweep

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
        return () if result.trusted else (_UNSOLVED,)

    def figures(self, result: "SimulatedResponse") -> Figures:
        from savgs_ident.report.fit.bode import response_figure
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
        return () if result.trusted else (_UNSOLVED,)

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
