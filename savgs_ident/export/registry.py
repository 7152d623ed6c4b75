"""The formats in which a model can be exported: one line each.

The module of a format is loaded when it is used, so that a missing package affects no other format. A new format is a
module with a function of the model and a folder that returns the files it wrote, and one line in :data:`EXPORTS`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

from savgs_ident.core.errors import InputError
from savgs_ident.export.exported_model import ExportedModel


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
