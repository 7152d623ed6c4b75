"""The public call ``export``, and the formats in which it writes a model, one line each.

The module of a format is loaded when it is used, so that a missing package affects no other format. A new format is a
module with a function of the model and a folder that returns the files it wrote, and one line in :data:`EXPORTS`.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar

from savgs_ident.core.errors import InputError, SavgsIdentError, blamed_on
from savgs_ident.core.files import prepare_folder
from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.gather import DIAGNOSIS_REMEDY, Gathered, gather, read_diagnosis
from savgs_ident.export.json_export import covariance_record
from savgs_ident.inference.draws import DrawSource
from savgs_ident.inference.result import Posterior
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.model import load_rig, model_of
from savgs_ident.simulate.program_cache import use_persistent_cache


@dataclass(frozen=True)
class Exporter:
    """A format: its description, and the function that writes it and returns the files it wrote."""

    about: str
    write: Callable[[ExportedModel, Path], tuple[Path, ...]]


def _exporter(writer: str, about: str) -> Exporter:
    """A format written by ``module.function`` of this package, which is imported when it is called."""
    module, _, function = writer.partition(".")

    def write(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
        if not folder.is_dir():
            raise InputError(
                "is no folder", source=folder, remedy="make it before anything is exported to it"
            )
        files: tuple[Path, ...] = getattr(import_module(f"{__package__}.{module}"), function)(model, folder)
        return files

    return Exporter(about, write)


EXPORTS: Mapping[str, Exporter] = MappingProxyType(
    {
        "json": _exporter(
            "json_export.write_json", "one versioned document with everything, and its JSON Schema"
        ),
        "mat": _exporter("mat_export.write_mat", "MATLAB: parameters, state spaces, frequency responses"),
        "python-control": _exporter(
            "python_control_export.write_python_control", "python-control: linear and nonlinear systems"
        ),
        "casadi": _exporter(
            "casadi_export.write_casadi", "CasADi: rates, outputs and residual as serialised functions"
        ),
        "c": _exporter("casadi_export.write_c", "C99 source of the same functions"),
        "fmu": _exporter(
            "fmu_export.write_fmu", "FMI 3.0 model exchange, compiled; needs FMPy and a C compiler"
        ),
    }
)
"""All formats by name."""


@dataclass(frozen=True)
class Exported(Result):
    """What an export wrote.

    Attributes:
        gathered: the model, where its numbers come from, and why it is not to be trusted.
        written: the files by format.
    """

    presenter: ClassVar[str] = "EXPORTED"

    gathered: Gathered
    written: Mapping[str, tuple[Path, ...]]

    @property
    def files(self) -> tuple[Path, ...]:
        """All files, each once."""
        return tuple(dict.fromkeys(file for files in self.written.values() for file in files))

    @property
    def trusted(self) -> bool:
        """Whether fit, diagnosis and posterior are sound and belong together."""
        return not self.gathered.doubts


def export(
    model: Model | str | Path,
    formats: str | Sequence[str],
    folder: str | Path,
    *,
    effects: Sequence[str] | None = None,
    posterior: Posterior | str | Path | None = None,
    samples: int = 500,
    diagnosis: Diagnosis | str | Path | None = None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Exported:
    """Export a model of any plant: parameters with covariance, draws, linear models, equations.

    Args:
        model: a plant with its effects, identified or drawn; or a rig file.
        formats: one or several of "json", "mat", "python-control", "casadi", "c" and "fmu".
        folder: where the files are written.
        effects: with which effects a rig file is taken; those that it was fitted with if left out, and for a drawing
            those of the model that was diagnosed, else those of the paper's SimTR.
        posterior: a posterior or a ``posterior.nc`` whose draws travel along.
        samples: how many of them, evenly spread over all.
        diagnosis: a diagnosis or a ``diagnosis.json``: the effects that it names, or the force that it learned, join
            the model with the numbers of its fit.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` for an unknown format, for what a format cannot
    hold, and for files that cannot be used or do not belong together.
    """
    names = (formats,) if isinstance(formats, str) else tuple(dict.fromkeys(formats))
    _check_formats(names)
    known = model_to_export(model, effects, diagnosis)
    out = prepare_folder(Path(folder))
    found, origin = gathered(known, posterior, samples, diagnosis), known.origin()
    _check_covariance(found.model, origin.model)
    use_persistent_cache()
    written = {}
    for name in names:
        progress(f"writing {name}")
        # What names no file of its own is a fault of the model's numbers.
        with blamed_on(origin.model):
            written[name] = _write(name, found.model, out)
    origin = replace(origin, effects=found.model.effects, command=tuple(command))
    return Exported(found, written, origin=origin)


def _check_formats(names: Sequence[str]) -> None:
    """Raise :class:`InputError` for a format that does not exist."""
    for name in names:
        if name not in EXPORTS:
            raise InputError(
                f"there is no format '{name}'", source="--to", remedy="choose among: " + ", ".join(EXPORTS)
            )


def model_to_export(
    model: Model | str | Path,
    effects: Sequence[str] | None = None,
    diagnosis: Diagnosis | str | Path | None = None,
) -> Model:
    """A model as it is, or that of a rig file: with ``effects``, else its own, else those that were diagnosed.

    Raises :class:`InputError` for a file that cannot be used, and for ``effects`` beside a model, which has its own.
    """
    if not isinstance(model, str | Path):
        if effects is not None:
            raise InputError("effects go with a rig file only", remedy="add them to the model with +")
        return model
    rig = load_rig(model)
    known = model_of(rig, effects)
    if effects is None and "effects" not in rig.provenance:
        known = model_of(rig, diagnosis_document(diagnosis, known).get("baseline", {}).get("effects"))
    return known


def gathered(
    model: Model,
    posterior: Posterior | str | Path | None = None,
    samples: int = 500,
    diagnosis: Diagnosis | str | Path | None = None,
) -> Gathered:
    """A model with what a posterior and a diagnosis say of it; raises as :func:`export` does."""
    source: DrawSource | None = Path(posterior) if isinstance(posterior, str) else posterior
    try:
        return gather(model, diagnosis_document(diagnosis, model), source, samples)
    except InputError as error:
        # What has no source is a fault of the diagnosis: the model has been read, and draws name their file.
        blamed = diagnosis if isinstance(diagnosis, str | Path) else ""
        raise InputError(
            error.what, source=error.source or blamed, remedy=error.remedy or DIAGNOSIS_REMEDY
        ) from None


def diagnosis_document(diagnosis: Diagnosis | str | Path | None, model: Model) -> dict[str, Any]:
    """What ``diagnosis.json`` says of a model; empty without one. Raises :class:`InputError` for no such file."""
    if diagnosis is None:
        return {}
    if isinstance(diagnosis, Diagnosis):
        document: dict[str, Any] = json.loads(diagnosis.to_json())
        return document
    return read_diagnosis(Path(diagnosis), model)


def _check_covariance(model: ExportedModel, source: str) -> None:
    try:
        covariance_record(model)
    except InputError as error:
        raise InputError(error.what, source=source, remedy="identify the model again") from None


def _write(name: str, model: ExportedModel, out: Path) -> tuple[Path, ...]:
    try:
        return EXPORTS[name].write(model, out)
    except InputError:
        raise
    except SavgsIdentError as error:
        # An effect whose law the format cannot hold.
        raise InputError(str(error), source=f"--to {name}", remedy="leave this format out") from error
