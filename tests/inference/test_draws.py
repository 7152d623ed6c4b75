"""Draws are read back as they were written, evenly thinned; what holds none is refused."""

import tracemalloc
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.inference.draws import far_from_draws, read_draws

CHAINS = np.arange(12.0).reshape(3, 4)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Three chains of four draws."""
    path = tmp_path / "posterior.nc"
    with h5py.File(path, "w") as file:
        file["posterior/a"] = CHAINS
        file["posterior/b"] = 10.0 * CHAINS
        file["posterior/noise_scale"] = CHAINS
    return path


def test_chains_follow_each_other(path: Path) -> None:
    found = read_draws(path, ("b", "a", "c"))
    assert list(found) == ["b", "a"]
    assert np.array_equal(found["a"], np.arange(12.0))


def test_draws_are_spread_evenly_and_stay_together(path: Path) -> None:
    found = read_draws(path, ("a", "b"), 4)
    assert np.array_equal(found["a"], [0.0, 3.0, 7.0, 11.0])
    assert np.array_equal(found["b"], 10.0 * found["a"])


def test_no_more_than_there_are(path: Path) -> None:
    assert read_draws(path, ("a",), 500)["a"].size == 12


def test_a_value_is_far_that_is_six_deviations_off_the_mean() -> None:
    draws = {"a": np.array([1.0, 3.0, 1.0, 3.0]), "b": np.array([1.0, 3.0, 1.0, 3.0])}
    assert far_from_draws({"a": 7.9, "b": 8.1}, draws) == ("b",)
    assert far_from_draws({"a": -4.1, "b": -3.9}, draws) == ("a",)
    assert far_from_draws({"a": 4.1, "b": 2.0}, draws, 2.0) == ("a",)


def test_a_single_draw_knows_nothing_and_draws_that_stand_still_know_all() -> None:
    still = {"a": np.full(4, 0.1)}
    assert far_from_draws({"a": 9.0}, {"a": np.array([0.1])}) == ()
    assert far_from_draws({"a": 0.1}, still) == ()
    assert far_from_draws({"a": 0.2}, still) == ("a",)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"other/a": CHAINS}, "is no posterior"),
        ({"posterior/x": CHAINS}, "no finite draws"),
        ({"posterior/a": CHAINS, "posterior/b": CHAINS[:2]}, "no finite draws"),
        ({"posterior/a": np.full((2, 2), np.nan)}, "no finite draws"),
        ({"posterior/a": np.zeros((0, 2))}, "no finite draws"),
        ({"posterior/a": np.arange(4)}, "no finite draws"),
        ({"posterior/a/b": CHAINS}, "is no posterior"),
    ],
)
def test_what_holds_no_draws_is_refused(tmp_path: Path, content: dict[str, np.ndarray], said: str) -> None:
    path = tmp_path / "x.nc"
    with h5py.File(path, "w") as file:
        for name, values in content.items():
            file[name] = values
    with pytest.raises(InputError) as caught:
        read_draws(path, ("a", "b"))
    assert said in caught.value.what
    assert caught.value.source == str(path)
    assert "savgs-ident posterior" in caught.value.remedy


@pytest.mark.parametrize(
    "declared",
    [
        {"shape": (1 << 40,), "chunks": (1 << 16,)},
        {"shape": (1 << 15, 1 << 15), "chunks": (64, 64), "fillvalue": 1.0},
        {"shape": (4,), "maxshape": (None,), "chunks": (1 << 27,)},
    ],
)
def test_numbers_that_are_declared_and_not_there_take_no_memory(
    tmp_path: Path, declared: dict[str, Any]
) -> None:
    path = tmp_path / "x.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("posterior/a", dtype="f8", **declared)
    assert path.stat().st_size < 100_000
    tracemalloc.start()
    with pytest.raises(InputError, match="declares more than"):
        read_draws(path, ("a",))
    assert tracemalloc.get_traced_memory()[1] < 1 << 22
    tracemalloc.stop()


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.nc").write_text("text")
    for name in ("x.nc", "none.nc"):
        with pytest.raises(InputError, match="cannot be read"):
            read_draws(tmp_path / name, ("a",))
