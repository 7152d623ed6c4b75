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

from savgs_ident.posterior.keep import open_keep
from savgs_ident.posterior.samplers import SAMPLERS

from .chains_on_disk import CASE
from .toy import Toy
from .toy_surrogate import Stand

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def inputs(bent: Toy, rough: Stand, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What all runs sample: found once, as another search for the mode may round otherwise."""
    path = tmp_path_factory.mktemp("inputs") / "toy.pickle"
    path.write_bytes(pickle.dumps((bent, rough.surrogate)))
    return path


class Runs:
    """Runs of a sampler with their chain at a path."""

    def __init__(self, name: str, inputs: Path, path: Path) -> None:
        self.name, self.inputs, self.path = name, inputs, path

    def start(self, last: int) -> "subprocess.Popen[str]":
        """A process that samples up to so many evaluations."""
        module = [sys.executable, "-m", "tests.posterior.chains_on_disk"]
        rest = [self.name, str(self.path), str(last), str(self.inputs)]
        relaxed = {key: value for key, value in os.environ.items() if not key.startswith("JAX_NUMPY_")}
        return subprocess.Popen(
            [*module, *rest], cwd=REPOSITORY, env=relaxed, stdout=subprocess.PIPE, text=True
        )

    def finish(self, last: int) -> None:
        """Run up to so many evaluations."""
        with self.start(last) as process:
            process.communicate()
        assert process.returncode == 0

    def kill(self, lines: int, pause: float) -> int:
        """Kill a run this long [s] after so many lines; the evaluations that it last said to be on disk."""
        with self.start(10**9) as process:
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
            found |= {f"{group.name}@{name}": np.asarray(value) for name, value in group.attrs.items()}
            found |= {each.name: each[...] for each in group.values() if isinstance(each, h5py.Dataset)}
    return found


def _check(name: str, kills: int, inputs: Path, folder: Path) -> None:
    """Kill runs, look at what they left, finish, and compare with an uninterrupted run."""
    random = np.random.default_rng(kills)
    killed, whole = (Runs(name, inputs, folder / f"{each}.h5") for each in ("killed", "whole"))
    for number in range(kills):
        # The first is killed before or in its first step, others after some steps, at any place within one.
        said = killed.kill(int(random.integers(3, 12)) if number else 1, random.uniform(0.0, 0.02))
        kept = open_keep(killed.path, CASE)
        assert killed.path.exists() == (kept.content is not None)
        assert kept.counts[0] >= said
    last = open_keep(killed.path, CASE).counts[0] + 64
    killed.finish(last)
    whole.finish(last)
    true = _content(whole.path)
    assert len(true) >= 6
    found = _content(killed.path)
    assert found.keys() == true.keys()
    for key, value in true.items():
        np.testing.assert_array_equal(found[key], value, err_msg=key)


@pytest.mark.parametrize(("name", "kills"), [("emcee", 3), ("nuts", 2)])
def test_a_killed_run_loses_nothing(name: str, kills: int, inputs: Path, tmp_path: Path) -> None:
    _check(name, kills, inputs, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLERS)
def test_a_run_that_is_killed_often_loses_nothing(name: str, inputs: Path, tmp_path: Path) -> None:
    _check(name, 20, inputs, tmp_path)
