"""CasADi: the explicit equations, the outputs and the implicit residual as serialised functions.

    rates = casadi.Function.load("rates.casadi")
    dx = rates(x, u, p)             # the order of names stands in signals.json

Nothing of this package is needed to load them. They are of SX and can be differentiated, mapped, and put into a
problem of optimal control as they are.
"""

from pathlib import Path

from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.export.casadi_functions import casadi_functions
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.json_export import write_json
from savgs_ident.export.json_text import write_json_text
from savgs_ident.export.signals import signals_record


def write_casadi(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write rates, outputs and residual (.casadi), signals.json, and all that is known of the model in model.json.

    Raises :class:`InputError` if one cannot be written, or the rig finds no rest.
    """
    record = signals_record(model)
    files = []
    for name, function in casadi_functions(model).items():
        # CasADi does not notice a disk that fills under it.
        with scratch_folder() as scratch:
            file = scratch / name
            function.save(str(file))
            files.append(write_bytes(folder / f"{name}.casadi", file.read_bytes()))
    signals = write_json_text(folder / "signals.json", record)
    return (*files, signals, *write_json(model, folder))
