"""``closed-loop`` on the shipped rig: run once, and what is made of it."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from click.testing import Result

from savgs_ident.control import public
from savgs_ident.control.closed_loop.laws import KINDS, NOTHING
from savgs_ident.control.closed_loop.programme import LoopKind, LoopTest
from savgs_ident.control.closed_loop.study import LoopStudy
from savgs_ident.plants.quarter_car.rig import default_rig_path

pytestmark = pytest.mark.slow

Invoke = Callable[..., Result]
RIG = default_rig_path()
RIGS = 2
PICTURES = ("closed-loop", "failures", "rigs", "causes")


@pytest.fixture(scope="module")
def run(
    cache: Path,
    tmp_path_factory: pytest.TempPathFactory,
    as_users_have_it: Callable[[Sequence[str]], Result],
) -> tuple[Path, Result, LoopStudy]:
    """The harmonic test with causes and other rigs: folder, outcome, and the study behind it."""
    folder = tmp_path_factory.mktemp("loop")
    found: list[LoopStudy] = []
    original = public.study_loop

    def remembering(*args: Any, **kwargs: Any) -> LoopStudy:
        found.append(original(*args, **kwargs))
        return found[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SAVGS_IDENT_CACHE", str(cache))
        patch.setattr(public, "study_loop", remembering)
        words = ["closed-loop", str(RIG), "--rigs", str(RIGS), "--causes", "--json", "--out", str(folder)]
        done = as_users_have_it(words)
    return folder, done, found[0]


def test_the_files_are_there_and_standard_output_is_the_record(run: Any) -> None:
    folder, done, _ = run
    assert done.exit_code == 0, done.stderr
    assert done.stdout == (folder / "closed-loop.json").read_text()
    pictures = [f"{stem}.{kind}" for stem in PICTURES for kind in ("pdf", "png")]
    files = sorted(["closed-loop.json", "closed-loop.csv", "closed-loop.html", *pictures])
    assert sorted(path.name for path in folder.iterdir()) == files
    page = (folder / "closed-loop.html").read_text()
    assert "<script" not in page.lower()
    assert page.count("<img ") == len(PICTURES)


def test_the_active_rig_rides_as_well_as_the_paper_asks(run: Any) -> None:
    record = json.loads(run[1].stdout)
    reduction = record["rms_reduction_percent"]
    assert reduction["sprung_accel"] >= 35.0
    assert reduction["susp_deflection"] >= 25.0
    assert record["tyre_load_rms_change_percent"] < 0.0
    assert record["stable"]
    assert 0.0 < record["motor_speed_peak_rpm"] < 3000.0
    assert record["saturated_fraction"] == 0.0
    assert record["saturated_from_hz"] is None
    low, high = record["link_angle_range_deg"]
    assert 20.0 < low < 90.0 < high < 160.0
    assert 0.0 < record["peak_power_w"] <= 500.0


def test_the_reduction_is_that_of_the_two_rides(run: Any) -> None:
    record = json.loads(run[1].stdout)
    for channel, key in (
        ("sprung_accel", "sprung_accel_rms_m_per_s2"),
        ("susp_deflection", "susp_deflection_rms_m"),
    ):
        ratio = record["active"][key] / record["passive"][key]
        assert record["rms_reduction_percent"][channel] == pytest.approx(100.0 * (1.0 - ratio))


def test_the_table_holds_the_signals_behind_the_figures(run: Any) -> None:
    folder, done, study = run
    record = json.loads(done.stdout)
    table = pd.read_csv(folder / "closed-loop.csv")
    evaluated = table[table["time [s]"].between(study.test.start, study.test.end, inclusive="left")]
    for prefix, ride in (("", "active"), ("passive_", "passive")):
        rms = evaluated[f"{prefix}sprung_accel [m/s^2]"].std(ddof=0)
        assert rms == pytest.approx(record[ride]["sprung_accel_rms_m_per_s2"], rel=1e-6)


def test_friction_is_what_stands_between_the_linear_prediction_and_the_rig(run: Any) -> None:
    causes = {each["variant"]: each for each in json.loads(run[1].stdout)["causes"]}
    as_it_is, linear = causes["the rig as it is"], causes["without effects, limits and noise"]
    lost = linear["susp_deflection"] - as_it_is["susp_deflection"]
    regained = causes["without rail_coulomb"]["susp_deflection"] - as_it_is["susp_deflection"]
    assert lost > 10.0
    assert regained > 0.5 * lost
    unlimited = causes["a drive without limits"]
    assert unlimited["sprung_accel"] == pytest.approx(as_it_is["sprung_accel"], rel=1e-3)


def test_every_failure_is_survived_and_reported(run: Any) -> None:
    failures = json.loads(run[1].stdout)["failures"]
    assert set(failures) == set(KINDS) - {NOTHING}
    for failure in failures.values():
        then = failure["from_then_on"]
        assert then["stable"]
        assert then["sprung_accel_rms_m_per_s2"] < 1.2 * failure["passive_then"]["sprung_accel_rms_m_per_s2"]
    off = failures["actuator-off"]["final_link_angle_deg"]
    assert min(abs(off), abs(off - 180.0)) < 5.0


def test_it_is_stable_on_the_other_rigs(run: Any) -> None:
    rigs = json.loads(run[1].stdout)["rigs"]
    assert rigs["count"] == rigs["stable"] == RIGS
    assert len(rigs["rms_reduction_percent"]) == RIGS


def test_a_loop_that_is_not_stable_is_code_1(
    invoke: Invoke, run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = run[2]
    unstable = replace(study, active_ride=replace(study.active_ride, stable=False))
    monkeypatch.setattr(public, "study_loop", lambda *args: unstable)
    done = invoke("closed-loop", RIG, "--quiet", "--out", "o")
    assert done.exit_code == 1
    assert done.stderr.startswith("Not to be trusted: The loop is not stable on this rig")
    assert "The loop is not stable" in Path("o/closed-loop.html").read_text()


@pytest.mark.parametrize(
    ("words", "name", "says"),
    [
        (("--test", "sweep"), LoopKind.sweep, "0 to 3 Hz in 60 s"),
        (("--test", "iso", "--road", "D", "--speed", "36"), LoopKind.iso, "class D at 36 km/h"),
        (("--test", "bump"), LoopKind.bump, "50 mm high and 2 m long, at 20 km/h"),
        (("--frequency", "1.5"), LoopKind.harmonic, "at 1.5 Hz"),
    ],
)
def test_the_test_asked_for_is_the_test_that_runs(
    invoke: Invoke,
    run: Any,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    name: LoopKind,
    says: str,
) -> None:
    asked: list[LoopTest] = []

    def study(_model: Any, _controller: Any, _called: str, test: LoopTest, *_rest: Any) -> LoopStudy:
        asked.append(test)
        return run[2]

    monkeypatch.setattr(public, "study_loop", study)
    assert invoke("closed-loop", RIG, *words, "--rigs", "0", "--quiet", "--out", "o").exit_code == 0
    assert asked[0].name is name
    assert says in asked[0].title


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--controller", "nowhere.json"), "nowhere.json: cannot be read"),
        (("--posterior", "nowhere.nc"), "nowhere.nc: cannot be read"),
        (("--controller", str(RIG)), "is not JSON"),
    ],
)
def test_bad_input_is_one_line_and_code_2(invoke: Invoke, words: tuple[str, ...], says: str) -> None:
    done = invoke("closed-loop", RIG, *words, "--out", "o", "--quiet")
    assert done.exit_code == 2
    assert says in done.stderr
    assert "Remedy:" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "words", [("--frequency", "0"), ("--road", "Z"), ("--speed", "-3"), ("--rigs", "-1")]
)
def test_usage_errors_are_code_2(invoke: Invoke, words: tuple[str, ...]) -> None:
    assert invoke("closed-loop", RIG, *words).exit_code == 2
