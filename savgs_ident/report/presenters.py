"""How each class of results is shown: its JSON object, its text, its report, its pictures, its files.

A result names its presenter (:mod:`savgs_ident.core.presentation`); the command line and a notebook show it by the
same one. Presenters are in files that are loaded when something is to be shown, and load what draws when something
is drawn:

    presenters.FIT.shown(fit)

:func:`plot_bode` is what ``import savgs_ident`` offers of pictures besides: the frequency response of whatever has
one.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from rich.console import Group, RenderableType

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import write_bytes, write_json
from savgs_ident.core.presentation import Progress, Result
from savgs_ident.report.text import data_warnings

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

    def shown(self, result: Shown) -> RenderableType:
        """The same, and what the checks of the data found."""
        return Group(self.text(result), *data_warnings(result.origin.warnings))

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


_FILES = {
    "CAMPAIGN_SUMMARY": "present_campaign",
    "CAMPAIGN_STUDY": "present_studies",
    "BLIND_STUDY": "present_studies",
    "ALARM_STUDY": "present_validation",
    "CALIBRATION_STUDY": "present_validation",
    "FIT": "present_campaign",
    "MOTION_FIT": "present_campaign",
    "COMPARISON": "present_campaign",
    "MOTION_COMPARISON": "present_campaign",
    "SIMULATED_RESPONSE": "present_models",
    "SIMULATED_SWEEP": "present_models",
    "POSTERIOR": "present_campaign",
    "MOTION_POSTERIOR": "present_campaign",
    "DIAGNOSIS": "present_campaign",
    "LINEAR_STUDY": "present_models",
    "DESIGN": "present_models",
    "LOOP_STUDY": "present_models",
    "EXPORTED": "present_models",
    "PLANT_CHECK": "present_validation",
    "CAMPAIGN_PLAN": "present_validation",
}


def __getattr__(name: str) -> "Presenter":
    """The presenter ``name``, from its file."""
    if name not in _FILES:
        raise AttributeError(f"there is no presenter {name!r}")
    found: Presenter = getattr(import_module(f"savgs_ident.report.{_FILES[name]}"), name)
    return found


_FIGURES = {
    "FIT": "bode",
    "COMPARISON": "bode",
    "SIMULATED_RESPONSE": "simulate",
    "POSTERIOR": "predicted",
    "MOTION_POSTERIOR": "predicted",
    "DIAGNOSIS": "bode",
}
"""By presenter, the first word of the name of the figure that shows the response."""


def plot_bode(result: Result) -> "Figure":
    """Magnitude, phase and peak to peak over frequency: the model against the measurement where there is one.

    Of a fit, a comparison, a simulated response, a posterior or a diagnosis. The other figures of a result are
    ``result.figure(name)``, with a name of ``result.figure_names``.

    Raises :class:`InputError` for a result that has no frequency response.
    """
    names = [each for each in result.figure_names if each.split(" ")[0] == _FIGURES.get(result.presenter)]
    if not names:
        raise InputError(
            f"a {type(result).__name__} has no frequency response",
            remedy="choose among its figures: " + ", ".join(result.figure_names),
        )
    return result.figure(names[0])
