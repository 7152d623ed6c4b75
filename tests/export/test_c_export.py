"""The C code, compiled, computes what the functions of CasADi compute."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from savgs_ident.export.casadi_export import STEM, write_c
from savgs_ident.export.exported_model import ExportedModel, casadi_functions, resting_inputs, resting_state
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.rig import Rig

pytestmark = pytest.mark.slow

COMPILER = shutil.which("cc") or shutil.which("gcc")


@pytest.fixture(scope="module")
def model(rig: Rig) -> ExportedModel:
    """The rig with its friction."""
    return ExportedModel(rig, MODELS["simtr"])


@pytest.fixture(scope="module")
def library(model: ExportedModel, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The exported source, compiled without a warning."""
    if COMPILER is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("c")
    files = write_c(model, folder)
    assert {path.name for path in files} == {f"{STEM}.c", f"{STEM}.h", "signals.json", "model.json"}
    shared = folder / "model.so"
    strict = ["-std=c99", "-Wall", "-Werror", "-Wno-unused", "-O1", "-fPIC", "-shared"]
    subprocess.run([COMPILER, *strict, str(folder / f"{STEM}.c"), "-o", str(shared), "-lm"], check=True)
    return ctypes.CDLL(str(shared))


def _call(library: ctypes.CDLL, name: str, arguments: list[np.ndarray], size: int) -> np.ndarray:
    work = (ctypes.c_longlong * 4)()
    pointers = [ctypes.byref(work, 8 * place) for place in range(4)]
    assert getattr(library, f"{name}_work")(*pointers) == 0
    sz_arg, sz_res, sz_iw, sz_w = work
    result = np.zeros(size)
    double = ctypes.POINTER(ctypes.c_double)
    arg, res = (double * sz_arg)(), (double * sz_res)()
    for place, value in enumerate(arguments):
        arg[place] = value.ctypes.data_as(double)
    res[0] = result.ctypes.data_as(double)
    iw, w = (ctypes.c_longlong * max(sz_iw, 1))(), (ctypes.c_double * max(sz_w, 1))()
    assert getattr(library, name)(arg, res, iw, w, 0) == 0
    return result


def test_the_compiled_functions_are_the_functions(library: ctypes.CDLL, model: ExportedModel) -> None:
    functions = casadi_functions(model)
    rest, still = np.array(resting_state(model)), np.array(resting_inputs(model))
    p = np.array(model.table.values_of(model.equations.parameters))
    random = np.random.default_rng(11)
    for name in ("rates", "outputs"):
        for _ in range(50):
            x = rest + 1e-2 * random.standard_normal(rest.size)
            u = still + 1e-2 * random.standard_normal(still.size)
            expected = functions[name](x, u, p).full().ravel()
            reported = _call(library, name, [x, u, p], expected.size)
            assert reported == pytest.approx(expected, rel=1e-9, abs=1e-6)
