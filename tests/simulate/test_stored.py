"""A stored program is the program: same numbers in a later run, made anew where the file is not whole."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

_SOLVE = """
import jax.monitoring
import numpy as np

from savgs_ident.core.rig import default_rig_path, read_rig
from savgs_ident.effects.registry import MODELS, build_model, model_parameters
from savgs_ident.model.values import as_values
from savgs_ident.simulate.compilation import use_persistent_cache
from savgs_ident.simulate.excitation import cam_excitation
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic

if {kept}:
    use_persistent_cache()
rig = read_rig(default_rig_path())
p = as_values(model_parameters(rig, MODELS["simtr"]).as_dict())
model = build_model(rig, MODELS["simtr"])
lowered = []
jax.monitoring.register_event_duration_secs_listener(
    lambda name, seconds, **of: lowered.append(of.get("fun_name")) if "mlir" in name else None
)
settings = PeriodicSettings(nodes=32)
solution = simulate_periodic(model, p, cam_excitation([2.0, 3.0], 0.0275, np.pi / 2), settings)
print("jit(of_arrays)" in lowered, np.asarray(harmonics(model, p, solution, 5)).tobytes().hex())
"""


def _run(folder: Path, kept: bool = True) -> tuple[bool, str]:
    as_users_have_it = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    environment = as_users_have_it | {"SAVGS_IDENT_CACHE": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", _SOLVE.format(kept=kept)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    traced, numbers = done.stdout.split()
    return traced == "True", numbers


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A cache after one run, and the numbers of that run."""
    folder = tmp_path_factory.mktemp("cache")
    traced, numbers = _run(folder)
    assert traced
    return folder, numbers


def test_a_later_run_does_not_trace_and_finds_the_same(first: tuple[Path, str]) -> None:
    folder, numbers = first
    assert _run(folder) == (False, numbers)


def test_without_a_cache_the_numbers_are_the_same(first: tuple[Path, str], tmp_path: Path) -> None:
    assert _run(tmp_path, kept=False) == (False, first[1])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("left", [0.5, 0.0], ids=["half", "empty"])
def test_a_file_that_is_not_whole_is_made_anew(first: tuple[Path, str], left: float) -> None:
    folder, numbers = first
    (file,) = folder.glob("traced-*")
    whole = file.read_bytes()
    file.write_bytes(whole[: int(left * len(whole))])
    assert _run(folder) == (True, numbers)
    assert len(file.read_bytes()) == len(whole)
