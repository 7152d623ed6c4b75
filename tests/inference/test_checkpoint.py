"""Chains on disk: stopped and continued they are the same, and what is not theirs is left alone."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.inference.sample import SAMPLERS
from savgs_ident.inference.samplers.chains import (
    Chains,
    Checkpoint,
    digest_of,
    new_checkpoint,
    open_checkpoint,
)

from .toy import Toy
from .toy_surrogate import Stand

STRETCHES = 5
"""How often chains grow in the tests."""

EACH = [pytest.param(name, marks=pytest.mark.slow if name == "nuts" else ()) for name in SAMPLERS]
"""The samplers; NUTS takes long to compile, and what is on disk is one code for all."""


class _InterruptError(Exception):
    """The run is stopped."""


class Interrupted:
    """The toy, stopped when it is asked once more than ``calls`` times."""

    def __init__(self, toy: Toy, calls: int) -> None:
        self.toy, self.likelihood, self.calls = toy, toy.likelihood, calls

    def rows(self, us: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.calls -= 1
        if self.calls < 0:
            raise _InterruptError
        return self.toy.rows(us)


@pytest.fixture(scope="module")
def partly(bent: Toy, rough: Stand) -> Toy:
    """A model that is not solved everywhere, so that there is something to count."""
    return replace(bent, edge=float(rough.point[0]) + 0.15)


def _grown(name: str, toy: Toy, stand: Stand, keep: Checkpoint, stretches: int) -> Chains:
    """The chains after so many stretches in all."""
    sampler = SAMPLERS[name](toy, stand.surrogate, 5, keep)
    uninterrupted = next(sampler)
    for _ in range(stretches - 1):
        uninterrupted = next(sampler)
    sampler.close()
    return uninterrupted


def _continued(name: str, toy: Toy, stand: Stand, path: Path, length: int) -> Chains:
    sampler = SAMPLERS[name](toy, stand.surrogate, 5, open_checkpoint(path, "case"))
    chains = next(sampler)
    while len(chains.points) < length:
        chains = next(sampler)
    sampler.close()
    return chains


def _assert_same(chains: Chains, other: Chains) -> None:
    for one, two in zip(chains, other, strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.slow
@pytest.mark.parametrize("calls", [(1,), (4,), (7,), (2, 1, 3)], ids=str)
@pytest.mark.parametrize("name", EACH)
def test_a_chain_that_was_stopped_is_the_same(
    name: str,
    calls: tuple[int, ...],
    partly: Toy,
    rough: Stand,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Stopped after so many calls of the model, and again after so many more."""
    straight = _grown(name, partly, rough, new_checkpoint(None, ""), STRETCHES)
    path = tmp_path / "chain.h5"
    for count in calls:
        stopped = Interrupted(partly, count)
        with pytest.raises(_InterruptError):
            for _ in SAMPLERS[name](stopped, rough.surrogate, 5, open_checkpoint(path, "case")):
                pass
    # A stop may leave any number of steps: only a run that grows step by step ends at the same number as the other.
    monkeypatch.setattr(f"savgs_ident.inference.samplers.{name}._STRIDE", 1)
    _assert_same(_continued(name, partly, rough, path, len(straight.points)), straight)


@pytest.mark.parametrize("name", EACH)
def test_nothing_is_lost_between_two_runs(name: str, partly: Toy, rough: Stand, tmp_path: Path) -> None:
    path = tmp_path / "chain.h5"
    first = _grown(name, partly, rough, new_checkpoint(path, "case"), 3)
    assert open_checkpoint(path, "case").counts == (first.evaluations, first.unsolved)
    assert first.unsolved > 0
    _assert_same(
        _continued(name, partly, rough, path, len(first.points) + 1),
        _grown(name, partly, rough, new_checkpoint(None, ""), 4),
    )


@pytest.mark.parametrize("name", EACH)
def test_a_new_checkpoint_begins_anew(name: str, partly: Toy, rough: Stand, tmp_path: Path) -> None:
    path = tmp_path / "chain.h5"
    _grown(name, partly, rough, new_checkpoint(path, "another"), 2)
    again = _grown(name, partly, rough, new_checkpoint(path, "case"), 1)
    assert open_checkpoint(path, "case").counts[0] == again.evaluations
    assert [each.name for each in tmp_path.iterdir()] == ["chain.h5"]


def _kept(folder: Path) -> bytes:
    """The content of a chain file of the case "case"."""
    scratch = folder / "scratch.h5"
    with h5py.File(scratch, "w") as file:
        file["t"] = np.random.default_rng(0).standard_normal((50, 4, 5))
    new_checkpoint(folder / "whole.h5", "case").publish(scratch, (7, 1))
    return (folder / "whole.h5").read_bytes()


def _without_its_mark(folder: Path, content: bytes) -> bytes:
    path = folder / "plain.h5"
    path.write_bytes(content)
    with h5py.File(path, "a") as file:
        for name in list(file.attrs):
            del file.attrs[name]
    return path.read_bytes()


@pytest.mark.parametrize("kind", ["another case", "half", "a few bytes", "empty", "text", "plain HDF5"])
def test_a_file_that_is_no_chain_of_this_case_is_refused_and_left_alone(kind: str, tmp_path: Path) -> None:
    whole = _kept(tmp_path)
    content = {
        "another case": whole,
        "half": whole[: len(whole) // 2],
        "a few bytes": whole[:10],
        "empty": b"",
        "text": b"name,value\nmu_r,0.03\n",
        "plain HDF5": _without_its_mark(tmp_path, whole),
    }[kind]
    path = tmp_path / "chain.h5"
    path.write_bytes(content)
    with pytest.raises(InputError, match="resume") as caught:
        open_checkpoint(path, "this case" if kind == "another case" else "case")
    assert caught.value.source == str(path)
    assert path.read_bytes() == content


def test_a_file_that_is_not_as_it_was_written_is_refused_before_it_is_used(tmp_path: Path) -> None:
    whole = _kept(tmp_path)
    path = tmp_path / "chain.h5"
    for place in range(0, len(whole), len(whole) // 50):
        changed = bytearray(whole)
        changed[place] ^= 4
        path.write_bytes(changed)
        with pytest.raises(InputError, match="not as it was written"):
            open_checkpoint(path, "case")


def test_the_kept_file_is_hdf5_to_others(tmp_path: Path) -> None:
    _kept(tmp_path)
    with h5py.File(tmp_path / "whole.h5") as file:
        assert file["t"].shape == (50, 4, 5)


def test_a_kept_file_comes_back_as_it_was(tmp_path: Path) -> None:
    content = _kept(tmp_path)
    keep = open_checkpoint(tmp_path / "whole.h5", "case")
    assert keep.counts == (7, 1)
    # Behind the content stands its digest.
    assert keep.content is not None
    assert content.startswith(keep.content)
    with keep.scratch() as scratch:
        assert scratch.read_bytes() == keep.content
    assert not scratch.exists()


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        open_checkpoint(tmp_path, "case")


def test_a_digest_sees_every_number() -> None:
    parts = {"numbers": np.arange(3.0), "text": ("a", 1.0)}
    others = [
        parts | {"numbers": np.array([0.0, 1.0, np.nextafter(2.0, 3.0)])},
        parts | {"text": ("a", 1.0 + 1e-15)},
        {"other": parts["numbers"], "text": parts["text"]},
    ]
    assert digest_of(parts) == digest_of(dict(parts))
    assert len({digest_of(each) for each in (parts, *others)}) == 4
