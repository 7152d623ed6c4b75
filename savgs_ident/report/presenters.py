"""How each class of results is shown: its JSON object, its text, its report, its pictures, its files.

A result names its presenter (:mod:`savgs_ident.core.presentation`); the command line and a notebook show it by the
same one. Each room has its presenters in ``present.py``, which is loaded when something is to be shown:

    presenters.FIT.text(fit)
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from rich.console import RenderableType

from savgs_ident.core.files import write_bytes
from savgs_ident.core.output import write_json
from savgs_ident.core.presentation import Progress, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from savgs_ident.core.presentation import Presenter

Shown = TypeVar("Shown", bound=Result)
Figures = Mapping[str, "Callable[[], Figure]"]


class AbstractPresenter(ABC, Generic[Shown]):
    """What presenters have in common: the numbers are written first, then tables, pictures and the report."""

    stem: str
    """The name of the files without their endings."""

    @abstractmethod
    def record(self, result: Shown) -> Mapping[str, Any]:
        """The JSON object of the result."""

    @abstractmethod
    def text(self, result: Shown) -> RenderableType:
        """Tables and sentences for a terminal."""

    @abstractmethod
    def doubts(self, result: Shown) -> tuple[str, ...]:
        """Why the result is not to be trusted, a sentence each; empty if it is."""

    def page(self, result: Shown) -> str | None:
        """The report as HTML; None where there is none."""
        del result
        return None

    def figures(self, result: Shown) -> Figures:
        """What draws its figures, by name."""
        del result
        return {}

    def write(self, result: Shown, folder: Path, progress: Progress) -> Iterator[Path]:
        """The files, each as soon as it is there."""
        yield write_json(folder / f"{self.stem}.json", self.record(result))
        yield from self.more(result, folder)
        progress("drawing")
        yield from self.draw(result, folder)
        page = self.page(result)
        if page is not None:
            progress("writing the report")
            yield write_bytes(folder / f"{self.stem}.html", page.encode())

    def more(self, result: Shown, folder: Path) -> Iterator[Path]:
        """Files besides record, pictures and report."""
        del result, folder
        yield from ()

    def draw(self, result: Shown, folder: Path) -> Iterator[Path]:
        """The pictures, a ``png`` and a ``pdf`` each."""
        from savgs_ident.report.theme import write_figure

        for name, figure in self.figures(result).items():
            yield from write_figure(folder, name, figure())


def is_quarter_car(model: object) -> bool:
    """Whether a model is one of the quarter car, of which there is a drawing and a rig file."""
    from savgs_ident.plants.quarter_car.model import RigModel

    return isinstance(model, RigModel)


_ROOMS = {
    "CAMPAIGN_SUMMARY": "campaigns.present",
    "CAMPAIGN_STUDY": "campaigns.present",
    "BLIND_STUDY": "validation.present",
    "ALARM_STUDY": "validation.present",
    "CALIBRATION_STUDY": "validation.present",
    "FIT": "fit.present",
    "COMPARISON": "fit.present",
    "SIMULATED_RESPONSE": "present",
    "SIMULATED_SWEEP": "present",
    "POSTERIOR": "posterior.present",
    "DIAGNOSIS": "diagnosis.present",
    "LINEAR_STUDY": "control.present",
    "DESIGN": "control.present",
    "LOOP_STUDY": "control.present",
    "EXPORTED": "present",
}


def __getattr__(name: str) -> "Presenter":
    """The presenter ``name``, from its room."""
    if name not in _ROOMS:
        raise AttributeError(f"there is no presenter {name!r}")
    found: Presenter = getattr(import_module(f"savgs_ident.report.{_ROOMS[name]}"), name)
    return found
