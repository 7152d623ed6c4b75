"""The presenter of a diagnosis; what draws is loaded when something is drawn."""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from savgs_ident.core.files import write_bytes
from savgs_ident.core.output import write_json
from savgs_ident.core.presentation import Progress
from savgs_ident.report.presenters import AbstractPresenter, Figures, is_quarter_car

if TYPE_CHECKING:
    from savgs_ident.diagnosis.result import Diagnosis


class _Diagnosis(AbstractPresenter["Diagnosis"]):
    stem = "diagnosis"
    packages = ("jax", "numpy", "scipy")
    """Whose version matters to a diagnosis."""

    def record(self, result: "Diagnosis") -> Mapping[str, Any]:
        from savgs_ident.report.diagnosis.record import diagnosis_record

        return diagnosis_record(result, result.origin.with_versions(self.packages))

    def text(self, result: "Diagnosis") -> RenderableType:
        from savgs_ident.report.diagnosis.text import diagnosis_text

        return diagnosis_text(result)

    def doubts(self, result: "Diagnosis") -> tuple[str, ...]:
        return () if result.trusted else result.warnings

    def page(self, result: "Diagnosis") -> str | None:
        from savgs_ident.report.diagnosis.page import diagnosis_html

        return diagnosis_html(result, result.origin.with_versions(self.packages))

    def figures(self, result: "Diagnosis") -> Figures:
        from savgs_ident.report.diagnosis.bode import diagnosis_bode_figure
        from savgs_ident.report.diagnosis.drawing import rig_figure
        from savgs_ident.report.diagnosis.drive import drive_figure
        from savgs_ident.report.diagnosis.figures import force_figure, gap_map_figure, shrink_figure

        shrink: Figures = {"shrink": lambda: shrink_figure(result)}
        loops: Figures = {
            f"force {number}": partial(force_figure, result, loop) for number, loop in enumerate(result.loops)
        }
        if result.measured is None:
            return {"drive": lambda: drive_figure(result), **shrink, **loops}
        names = [each.name for each in result.given.channels]
        drawing: Figures = {"ports": lambda: rig_figure(result)} if is_quarter_car(result.given) else {}
        return {
            **{f"gap {name}": partial(gap_map_figure, result, name) for name in names},
            **drawing,
            **shrink,
            **{f"bode {name}": partial(diagnosis_bode_figure, result, c) for c, name in enumerate(names)},
            **loops,
        }

    def write(self, result: "Diagnosis", folder: Path, progress: Progress) -> Iterator[Path]:
        progress("writing")
        page = self.page(result)
        yield write_json(folder / "diagnosis.json", self.record(result))
        if page is not None:
            yield write_bytes(folder / "diagnosis.html", page.encode())


DIAGNOSIS = _Diagnosis()
