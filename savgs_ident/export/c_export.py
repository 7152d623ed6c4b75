"""C: the same functions as C99 without dependencies, for a real-time computer or a simulation of one's own.

Each function has CasADi's signature

    int rates(const double** arg, double** res, casadi_int* iw, double* w, int mem);

signals.json says what stands where, ``rates_work`` how much work space is needed. Null pointers stand for zeros
(inputs) and for what is not asked (results).
"""

import contextlib
from pathlib import Path

from casadi import CodeGenerator

from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.export.casadi_functions import casadi_functions
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.json_export import write_json
from savgs_ident.export.json_text import write_json_text
from savgs_ident.export.signals import signals_record

STEM = "savgs_model"
"""Name of the source and of its header."""


def write_c(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write savgs_model.c, savgs_model.h and signals.json, and all that is known about the model in model.json.

    Raises :class:`InputError` if one cannot be written, or the rig finds no rest.
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
