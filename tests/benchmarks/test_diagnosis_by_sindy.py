"""The peer of the diagnosis on regressions made by hand: what it can find it must be allowed to find."""

from dataclasses import dataclass

import numpy as np
import pytest

from benchmarks.diagnosis_by_sindy import Marks, Trial, _apart, by_frols, by_stlsq, marks_of, peers

RNG = np.random.default_rng(3)


@dataclass(frozen=True)
class Library:
    names: tuple[str, ...]
    columns: np.ndarray


def _library() -> Library:
    columns = RNG.standard_normal((600, 5))
    return Library(("lag", "gain|tilt", "mass", "spring", "delay"), columns / np.linalg.norm(columns, axis=0))


def _trial(kind: str, truth: str, size: float, ours: str | None = None) -> Trial:
    library = _library()
    place = next((place for place, name in enumerate(library.names) if truth and truth in name.split("|")), 0)
    residual = size * library.columns[:, place] + RNG.standard_normal(600)
    return Trial(kind, truth, ours, library.names, library.columns, residual)


TRIALS = [
    _trial("effect", "lag", 40.0, "lag"),
    _trial("effect", "tilt", 30.0, "gain"),
    _trial("effect", "delay", 60.0, None),
    _trial("none", "", 0.0, None),
    _trial("none", "", 0.0, "lag"),
]


def test_marks_count_names_and_alarms() -> None:
    assert marks_of([each.ours for each in TRIALS], TRIALS) == Marks(right=1, effects=3, alarms=1, nothing=2)
    assert marks_of(["lag", "gain|tilt", "delay", None, None], TRIALS) == Marks(3, 3, 0, 2)


def test_columns_that_are_the_same_stand_under_all_their_names() -> None:
    library = _library().columns
    names, kept = _apart(("a", "b", "c"), np.stack([library[:, 0], library[:, 1], -library[:, 0]], axis=1))
    assert names == ("a|c", "b")
    np.testing.assert_array_equal(kept, library[:, :2])


def test_peers_find_what_stands_out_and_keep_quiet_about_noise() -> None:
    pytest.importorskip("pysindy")
    assert peers(TRIALS) == {"stlsq": Marks(3, 3, 0, 2), "frols": Marks(3, 3, 0, 2)}
    for peer in (by_stlsq, by_frols):
        assert peer(TRIALS[0], 10.0) == "lag"
        assert peer(TRIALS[0], 100.0) is None
