"""The C code, compiled, computes what the functions of CasADi compute."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from savgs_ident.export.casadi_export import STEM, write_c
from savgs_ident.export.exported_model import ExportedModel, casadi_functions, resting_inputs, resting_state
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

from .c_library import call

pytestmark = pytest.mark.slow

COMPILER = shutil.which("cc") or shutil.which("gcc")


@pytest.fixture(scope="module")
def model(rig: Rig) -> ExportedModel:
    """The rig with its friction."""
    return ExportedModel(RigModel(rig, MODELS["simtr"]))


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
            reported = call(library, name, [x, u, p], expected.size)
            assert reported == pytest.approx(expected, rel=1e-9, abs=1e-6)
