"""The peers of the diagnosis on regressions made by hand: what they can find they must be allowed to find."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.diagnosis_peers import choose, compare, marks_of, merit, scores_of, shares_of
from benchmarks.figures import FIGURES
from benchmarks.sparse_selection import PEERS, THRESHOLDS, by_frols, by_lasso, by_stlsq
from benchmarks.trial_regression import VARIANTS, Regression, Trial, merged, trial_folders
from savgs_ident.validation.blind_answer import Answer, SmallErrors

ROWS = 600
NAMES = ("accel_lag", "accel_gain|accel_tilt", "sprung_mass", "joint_friction", "rail_stribeck")


def regression(random: np.random.Generator, named: str = "", size: float = 0.0) -> Regression:
    """Noise, and a column of a name at a size in standard deviations."""
    library = random.standard_normal((ROWS, len(NAMES)))
    library /= np.linalg.norm(library, axis=0)
    place = next((place for place, name in enumerate(NAMES) if named and named in name.split("|")), 0)
    residual = size * library[:, place] + random.standard_normal(ROWS)
    return Regression(NAMES, library, np.array([False, True, True, False, False]), residual)


NOTHING = Answer(1, "none", (), (), {}, {}, (), {}, {}, ())
FOREIGN = replace(
    NOTHING,
    kind="foreign",
    effects=("rail_dahl",),
    ports=("rail",),
    changes={"rail_dahl": 0.1},
    accepted=("rail", "frame"),
    families=("friction",),
    small_errors=SmallErrors((0.01,), 0.0, 0.0, 0.0),
)
OWN = replace(NOTHING, kind="effect", effects=("accel_tilt",), ports=("sensor.sprung_accel",))
OWN = replace(OWN, changes={"accel_tilt": 0.1})


def trials(answers: Sequence[Answer], found: Sequence[str], ours: Sequence[str | None]) -> list[Trial]:
    """Trials in whose recordings an effect stands out by 40 standard deviations, in one variant alone."""
    random = np.random.default_rng(3)
    made = []
    for number, (answer, name, said) in enumerate(zip(answers, found, ours, strict=True)):
        regressions = {variant: regression(random) for variant in VARIANTS}
        regressions[VARIANTS[-1]] = regression(random, name, 40.0 if name else 0.0)
        (score,) = scores_of(answer, said)
        made.append(Trial(Path("out") / f"trial_{number:04d}", answer, score, regressions))
    return made


def test_names_of_own_effects_are_marked_and_alarms() -> None:
    assert marks_of(scores_of(OWN, "accel_tilt")) == {"top1": True}
    assert marks_of(scores_of(OWN, "accel_gain|accel_tilt")) == {"top1": True}
    assert marks_of(scores_of(OWN, "accel_gain")) == marks_of(scores_of(OWN, None)) == {"top1": False}
    assert marks_of(scores_of(NOTHING, None)) == {"false_alarms": False}
    assert marks_of(scores_of(NOTHING, "accel_gain|accel_tilt")) == {"false_alarms": True}


@pytest.mark.parametrize(
    ("said", "port", "family"),
    [
        ("rail_stribeck", True, True),
        ("rail_viscous", True, False),
        ("frame_mode", True, False),
        ("joint_friction", False, False),
        ("joint_friction|rail_viscous", True, False),
        (None, False, False),
    ],
)
def test_foreign_effects_are_marked_by_port_and_family(said: str | None, port: bool, family: bool) -> None:
    assert marks_of(scores_of(FOREIGN, said)) == {"port": port, "family": family}


def test_merit_is_what_is_right_less_the_alarms() -> None:
    marks = [{"port": True, "family": False}, {"port": True, "family": True}, {"false_alarms": False}]
    assert shares_of(marks) == {"port": 1.0, "family": 0.5, "false_alarms": 0.0}
    assert merit(marks) == 0.75
    assert merit([*marks, {"false_alarms": True}]) == 0.25
    assert merit([{"top1": True}, {"top1": False}]) == 0.5


def test_columns_that_are_the_same_stand_under_all_their_names() -> None:
    whole = regression(np.random.default_rng(4))
    a, b = whole.library[:, 0], whole.library[:, 1]
    falls = np.array([False, False, False, False])
    given = Regression(("a", "b", "c", "a"), np.stack([a, b, -a, a], axis=1), falls, whole.residual)
    found = merged(given)
    assert found.names == ("a|c", "b")
    np.testing.assert_array_equal(found.library, whole.library[:, :2])
    # What grows to one side by one name grows to the other by the other.
    assert found.either_sign.tolist() == [True, False]


@pytest.mark.slow
def test_peers_find_what_stands_out_and_keep_quiet_about_noise() -> None:
    given = regression(np.random.default_rng(5), "accel_lag", 40.0)
    for peer in (by_stlsq, by_frols):
        said = dict(zip(THRESHOLDS, peer(given), strict=True))
        assert {name for limit, name in said.items() if 5.0 < limit < 35.0} == {"accel_lag"}
        assert said[THRESHOLDS[-1]] is None


def _lasso(library: np.ndarray, residual: np.ndarray, names: str, either_sign: bool = False) -> str | None:
    unit = library / np.linalg.norm(library, axis=0)
    signs = np.full(len(names), either_sign)
    (said,) = by_lasso(Regression(tuple(names), unit, signs, residual))
    return said


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_l1_selection_finds_the_column_among_others_like_it(sign: float) -> None:
    """Ten columns that have cosines of 0.8 with each other, one of them at 15 standard deviations."""
    random = np.random.default_rng(6)
    for truth in "adgj":
        library = random.standard_normal((ROWS, 10)) + 2.0 * random.standard_normal((ROWS, 1))
        column = library[:, "abcdefghij".index(truth)]
        residual = sign * 15.0 * column / np.linalg.norm(column) + random.standard_normal(ROWS)
        assert _lasso(library, residual, "abcdefghij", either_sign=True) == truth


@pytest.mark.slow
def test_l1_selection_keeps_signs_and_adds_up_what_shapes_of_an_effect_contribute() -> None:
    random = np.random.default_rng(7)
    library = random.standard_normal((ROWS, 3))
    unit = library / np.linalg.norm(library, axis=0)
    noise = random.standard_normal(ROWS)
    # Two shapes at 20 standard deviations each are more than another effect at 25.
    both = 20.0 * unit[:, 0] + 20.0 * unit[:, 1] + 25.0 * unit[:, 2] + noise
    assert _lasso(library, both, "aab") == "a"
    assert _lasso(library, both, "acb") == "b"
    # What cannot be negative is not what is missing.
    negative = -20.0 * unit[:, 0] + 10.0 * unit[:, 1] + noise
    assert _lasso(library, negative, "abc") == "b"
    assert _lasso(library, negative, "abc", either_sign=True) == "a"


@pytest.mark.slow
def test_l1_selection_keeps_something_of_pure_noise_once_in_the_root_of_the_rows() -> None:
    """0.041 of 600 rows: 4 of 100 expected, of which 10 or more have a probability of 0.008."""
    random = np.random.default_rng(8)
    library = random.standard_normal((ROWS, 10))
    said = [_lasso(library, random.standard_normal(ROWS), "abcdefghij", either_sign=True) for _ in range(100)]
    assert sum(each is not None for each in said) < 10


@pytest.mark.slow
def test_a_peer_is_compared_at_its_best_on_either_kind_of_trials() -> None:
    kinds = {
        "": trials([OWN, OWN, NOTHING], ["accel_tilt", "accel_gain", ""], ["accel_tilt", None, "accel_lag"]),
        "foreign_": trials(
            [FOREIGN, FOREIGN, replace(NOTHING, small_errors=FOREIGN.small_errors)],
            ["rail_stribeck", "joint_friction", ""],
            ["rail_viscous", "rail_stribeck", None],
        ),
    }
    wanted = {
        "": {"top1": (50.0, 100.0), "false_alarms": (100.0, 0.0)},
        "foreign_": {"port": (100.0, 50.0), "family": (50.0, 50.0), "false_alarms": (0.0, 0.0)},
    }
    for prefix, each in kinds.items():
        lines: list[str] = []
        outcome = compare(each, prefix, lines.append)
        figures = {f"{prefix}trials_effects": 2.0, f"{prefix}trials_nothing": 1.0}
        for mark, (ours, theirs) in wanted[prefix].items():
            figures |= {f"{prefix}{mark}_percent_{name}": theirs for name in PEERS}
            figures[f"{prefix}{mark}_percent_ours"] = ours
        assert outcome.figures == figures
        assert set(figures) <= set(FIGURES)
        assert len(lines) == 3
        assert all(str(VARIANTS[-1]) in note for note in outcome.notes)
        best = choose(by_frols, each)
        assert best.said[2] is None
        assert f"frols {best.said[0]}" in lines[0]


def test_trials_of_one_effect_or_none_count_that_were_diagnosed(tmp_path: Path) -> None:
    kinds = ["none", "effect", "two", "unknown", "foreign", "foreign"]
    for number, kind in enumerate(kinds):
        folder = tmp_path / f"trial_{number:04d}"
        folder.mkdir()
        (folder / "answer.json").write_text(json.dumps({"answer": {"kind": kind}}))
        if number < 5:
            (folder / "diagnosis.json").write_text("{}")
    assert [each.name for each in trial_folders(tmp_path)] == ["trial_0000", "trial_0001", "trial_0004"]


def test_nothing_to_compare_gives_no_figures() -> None:
    assert compare([], "", lambda line: None).figures == {}
