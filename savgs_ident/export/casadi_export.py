"""CasADi and C: the explicit equations, the outputs and the implicit residual as functions without this package.

For CasADi they are serialised functions of SX, which can be differentiated, mapped and used in optimal control as
they are:

    rates = casadi.Function.load("rates.casadi")
    dx = rates(x, u, p)             # the order of the names is in signals.json

For a real-time computer or another simulation they are C99 without dependencies, each with CasADi's signature:

    int rates(const double** arg, double** res, casadi_int* iw, double* w, int mem);

``rates_work`` returns the size of the work space. Null pointers stand for zeros (inputs) and for results that are not
wanted.
"""

import contextlib
from pathlib import Path

from casadi import CodeGenerator

from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.export.document import write_json_text
from savgs_ident.export.exported_model import ExportedModel, casadi_functions, signals_record
from savgs_ident.export.json_export import write_json


def write_casadi(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write rates, outputs and residual (.casadi), signals.json, and the whole model in model.json.

    Raises :class:`InputError` if one cannot be written, or the plant finds no rest.
    """
    record = signals_record(model)
    files = []
    for name, function in casadi_functions(model).items():
        # CasADi does not notice a full disk.
        with scratch_folder() as scratch:
            file = scratch / name
            function.save(str(file))
            files.append(write_bytes(folder / f"{name}.casadi", file.read_bytes()))
    signals = write_json_text(folder / "signals.json", record)
    return (*files, signals, *write_json(model, folder))


STEM = "savgs_model"
"""Name of the source and of its header."""


def write_c(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write savgs_model.c, savgs_model.h and signals.json, and the whole model in model.json.

    Raises :class:`InputError` if one cannot be written, or the plant finds no rest.
    """
    record = signals_record(model)
    with scratch_folder() as scratch, contextlib.chdir(scratch):
        generator = CodeGenerator(STEM, {"with_header": True, "casadi_int": "long long int"})
        for function in casadi_functions(model).values():
            generator.add(function)
        generator.generate()
        sources = {name: Path(name).read_bytes() for name in (f"{STEM}.c", f"{STEM}.h")}
    files = [write_bytes(folder / name, source) for name, source in sources.items()]
    signals = write_json_text(folder / "signals.json", record)
    return (*files, signals, *write_json(model, folder))
