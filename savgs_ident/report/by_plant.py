"""What reports have of one kind of plant alone: a drawing with its ports, and a file of the identified plant.

    figure = report_of(diagnosis.given).ports_figure(diagnosis)

A plant declares what there is of it in one line of :data:`PLANT_REPORTS`; others are drawn as a block. What draws is
loaded when something is drawn.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.plant import QuarterCar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from savgs_ident.diagnosis.result import Diagnosis
    from savgs_ident.fit.identified import Identified
    from savgs_ident.plants.model import PlantModel
    from savgs_ident.plants.quarter_car.model import RigModel


@dataclass(frozen=True)
class PlantReport:
    """What reports have of a plant.

    Attributes:
        write_model: writes the identified plant into a folder; the files.
        ports_figure: draws the plant with its ports, for a diagnosis of it.
        legend: a sentence or two that say what is what in that drawing.
    """

    write_model: Callable[["Identified", Path], Iterator[Path]]
    ports_figure: Callable[["Diagnosis"], "Figure"]
    legend: str


def _rig_figure(diagnosis: "Diagnosis") -> "Figure":
    from savgs_ident.report.diagnosis.drawing import rig_figure

    return rig_figure(diagnosis)


def _block_figure(diagnosis: "Diagnosis") -> "Figure":
    from savgs_ident.report.diagnosis.block_diagram import block_figure

    return block_figure(diagnosis)


def _write_rig(fit: "Identified", folder: Path) -> Iterator[Path]:
    from savgs_ident.plants.quarter_car.rig import write_rig

    write_rig(cast("RigModel", fit.model).rig, folder / "model.toml")
    yield folder / "model.toml"


def _write_plant_model(fit: "Identified", folder: Path) -> Iterator[Path]:
    from savgs_ident.plants.model_toml import write_model

    yield write_model(cast("PlantModel", fit.model), folder / "model.toml")


PLANT_REPORTS: Mapping[type[AbstractPlant], PlantReport] = {
    QuarterCar: PlantReport(
        _write_rig,
        _rig_figure,
        "Linkage, wheel and carriages to scale. Dots are the ports at which an unmodelled effect can act",
    ),
}
"""By the plant's class."""

OTHER = PlantReport(
    _write_plant_model,
    _block_figure,
    "Left what drives the plant, right what its sensors read; inside its equations the other ports at which an"
    " unmodelled effect can act",
)
"""Of plants that are not listed."""


def report_of(model: Model) -> PlantReport:
    """What reports have of the plant of a model; of one that is not listed a block with its ports."""
    plant = model.plant
    found = PLANT_REPORTS.get(plant if isinstance(plant, type) else type(plant))
    return found or OTHER
