"""The formats in which a model can be exported: one line each.

What a format needs is loaded when it is asked for: a package that is not there stands in the way of no other format.
To add one, write ``savgs_ident/export/<name>_export.py`` with a function ``write_<name>``, and name it here.
"""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

from savgs_ident.core.errors import InputError
from savgs_ident.export.exported_model import ExportedModel, Exporter


def _exporter(name: str, about: str) -> Exporter:
    """The function ``write_<name>`` of the format's file, found when it is called."""

    def write(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
        if not folder.is_dir():
            raise InputError(
                "is no folder", source=folder, remedy="make it before anything is exported to it"
            )
        files: tuple[Path, ...] = getattr(import_module(f"{__package__}.{name}_export"), f"write_{name}")(
            model, folder
        )
        return files

    return Exporter(about, write)


EXPORTS: Mapping[str, Exporter] = MappingProxyType(
    {
        "json": _exporter("json", "one versioned document with everything, and its JSON Schema"),
        "mat": _exporter("mat", "MATLAB: parameters, state spaces, frequency responses"),
        "python-control": _exporter("python_control", "python-control: linear and nonlinear systems"),
        "casadi": _exporter("casadi", "CasADi: rates, outputs and residual as serialised functions"),
        "c": _exporter("c", "C99 source of the same functions"),
        "fmu": _exporter("fmu", "FMI 3.0 model exchange, compiled; needs FMPy and a C compiler"),
    }
)
"""All formats by name."""
