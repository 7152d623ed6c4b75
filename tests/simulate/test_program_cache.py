"""A cached program is the program: same numbers in a later run, made anew where the file is not whole."""

import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from time import sleep
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import export
from numpy.typing import NDArray

from savgs_ident.core.small_root import solve_dense
from savgs_ident.simulate import program_cache
from savgs_ident.simulate.program_cache import done_once, first_alone, run_cached

_SOLVE = """
import jax.monitoring
import numpy as np

from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.core.values import as_values
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.simulate.readings import harmonics
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


@pytest.mark.slow
def test_a_later_run_does_not_trace_and_finds_the_same(first: tuple[Path, str]) -> None:
    folder, numbers = first
    assert _run(folder) == (False, numbers)


@pytest.mark.slow
def test_without_a_cache_the_numbers_are_the_same(first: tuple[Path, str], tmp_path: Path) -> None:
    assert _run(tmp_path, kept=False) == (False, first[1])
    assert not list(tmp_path.iterdir())


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """An empty folder for programs."""
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def test_a_program_is_traced_once_and_again_where_its_file_is_not_whole(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    matrix, right = jnp.asarray([[2.0, 1.0], [0.0, 3.0]]), jnp.asarray([4.0, 9.0])
    wanted = np.array([0.5, 3.0])
    traced: list[None] = []

    def counted(*args: Any, **options: Any) -> Any:
        traced.append(None)
        return export.export(*args, **options)

    monkeypatch.setattr(
        program_cache, "export", SimpleNamespace(export=counted, deserialize=export.deserialize)
    )

    def solved() -> NDArray[np.float64]:
        return np.asarray(run_cached(solve_dense, matrix, right))

    np.testing.assert_allclose(solved(), wanted)
    (file,) = folder.glob("traced-*")
    np.testing.assert_allclose(solved(), wanted)
    assert len(traced) == 1
    for count, left in enumerate((0.5, 0.0), start=2):
        whole = file.read_bytes()
        file.write_bytes(whole[: int(left * len(whole))])
        np.testing.assert_allclose(solved(), wanted)
        assert len(traced) == count
        np.testing.assert_allclose(solved(), wanted)
        assert len(traced) == count


def test_work_that_several_threads_ask_for_is_done_once_and_waited_for() -> None:
    done: list[int] = []
    together = Barrier(4)

    def ask(_: int) -> int:
        together.wait()
        done_once("what threads ask for", work)
        return len(done)

    def work() -> None:
        sleep(0.2)
        done.append(1)

    with ThreadPoolExecutor(4) as pool:
        seen = list(pool.map(ask, range(4)))
    assert seen == [1, 1, 1, 1]


def test_the_first_of_several_threads_is_alone_and_the_others_are_not() -> None:
    running, most = [0], [0]

    def program(_: float) -> float:
        running[0] += 1
        most[0] = max(most[0], running[0])
        alone.append(running[0])
        sleep(0.2)
        running[0] -= 1
        return 1.0

    alone: list[int] = []
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda _: first_alone(program, 2.0), range(4))) == [1.0] * 4
    assert alone[0] == 1
    assert most[0] > 1
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: first_alone(program, 2.0), range(4)))
    assert most[0] == 4


def test_work_that_failed_is_done_again() -> None:
    tried: list[int] = []

    def work() -> None:
        tried.append(1)
        if len(tried) == 1:
            raise RuntimeError("no memory")

    with pytest.raises(RuntimeError, match="no memory"):
        done_once("work that fails at first", work)
    done_once("work that fails at first", work)
    done_once("work that fails at first", work)
    assert len(tried) == 2


def test_what_the_user_asks_of_the_compiler_stays_and_nothing_is_asked_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_max_isa=SSE4_2 --xla_dump_to=there")
    for _ in range(2):
        program_cache.spare_the_compiler()
        flags = os.environ["XLA_FLAGS"].split()
        assert flags[:2] == ["--xla_cpu_max_isa=SSE4_2", "--xla_dump_to=there"]
        assert flags[2:] in ([], ["--xla_cpu_use_fusion_emitters=false"])
