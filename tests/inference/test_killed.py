"""A process that samples is killed at any moment and started again: its chain is the uninterrupted one."""

import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from savgs_ident.inference.sample import SAMPLERS
from savgs_ident.inference.samplers.chains import open_checkpoint

from .chains_on_disk import CASE
from .toy import Toy
from .toy_surrogate import Stand

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).resolve().parents[2]

KILLS = 3
"""How often a run is killed; each time a process is started, which compiles."""


@pytest.fixture(scope="module")
def inputs(bent: Toy, rough: Stand, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What all runs sample: found once, as another search for the mode may round otherwise."""
    path = tmp_path_factory.mktemp("inputs") / "toy.pickle"
    path.write_bytes(pickle.dumps((bent, rough.surrogate)))
    return path


def _started(name: str, last: int, inputs: Path, *paths: Path) -> "subprocess.Popen[str]":
    """A process that samples up to so many evaluations, into one chain after the other."""
    module = [sys.executable, "-m", "tests.inference.chains_on_disk"]
    rest = [name, str(last), str(inputs), *map(str, paths)]
    relaxed = {key: value for key, value in os.environ.items() if not key.startswith("JAX_NUMPY_")}
    return subprocess.Popen([*module, *rest], cwd=REPOSITORY, env=relaxed, stdout=subprocess.PIPE, text=True)


def _killed(name: str, lines: int, pause: float, inputs: Path, path: Path) -> int:
    """Kill a run this long [s] after so many lines; the evaluations that it last said to be on disk."""
    with _started(name, 10**9, inputs, path) as process:
        assert process.stdout is not None
        said = [int(process.stdout.readline()) for _ in range(lines)][-1]
        time.sleep(pause)
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read().split("\n")[:-1]
    assert process.returncode == -signal.SIGKILL
    return int(rest[-1]) if rest else said


def _content(path: Path) -> dict[str, np.ndarray]:
    """All that a chain file holds: draws, densities, counts, the state of random numbers."""
    found = {}
    with h5py.File(path, "r") as file:
        groups = [file, *[each for each in file.values() if isinstance(each, h5py.Group)]]
        for group in groups:
            # emcee makes room for several steps at once.
            steps = group.attrs.get("iteration")
            found |= {f"{group.name}@{name}": np.asarray(value) for name, value in group.attrs.items()}
            arrays = [each for each in group.values() if isinstance(each, h5py.Dataset)]
            found |= {each.name: each[:steps] if each.ndim > 1 else each[...] for each in arrays}
    return found


def _check(name: str, moments: list[int], inputs: Path, folder: Path) -> None:
    """Kill runs after so many lines, look at what they left, finish, and compare with an uninterrupted run."""
    random = np.random.default_rng(len(moments))
    path, whole = folder / "killed.h5", folder / "whole.h5"
    for lines in moments:
        # At any place within a step, which takes some ten milliseconds.
        said = _killed(name, lines, random.uniform(0.0, 0.02), inputs, path)
        kept = open_checkpoint(path, CASE)
        assert path.exists() == (kept.content is not None)
        assert kept.counts[0] >= said
    last = open_checkpoint(path, CASE).counts[0] + 64
    with _started(name, last, inputs, path, whole) as process:
        process.communicate()
    assert process.returncode == 0
    found, true = _content(path), _content(whole)
    assert found.keys() == true.keys()
    assert len(true) >= 6
    for key, value in true.items():
        np.testing.assert_array_equal(found[key], value, err_msg=key)


@pytest.mark.parametrize("name", SAMPLERS)
def test_a_run_that_is_killed_again_and_again_loses_nothing(name: str, inputs: Path, tmp_path: Path) -> None:
    """The first time before or in its first step."""
    moments = [1, *np.random.default_rng(3).integers(2, 12, KILLS - 1).tolist()]
    _check(name, moments, inputs, tmp_path)
