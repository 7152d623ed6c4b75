"""Blind trials on disk: kept, gone on with, diagnosed again, refused; and how the command ends."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from savgs_ident.cli.console import NOT_TRUSTED, OK, Reporter
from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig import default_rig_path
from savgs_ident.validation.blind import BlindRequest
from savgs_ident.validation.blind_trial import Drawn

from .blind_fakes import always_none, always_right, concluded, draw, request

pytestmark = pytest.mark.usefixtures("undrawn")

REPOSITORY = Path(__file__).resolve().parents[2]
SILENT = Reporter(False, True)


def _never(*_: object) -> Any:
    raise AssertionError("this is there already")


def _record(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "blind.json").read_text())
    return found


def test_a_run_that_goes_on_equals_one_that_was_never_stopped(tmp_path: Path) -> None:
    assert concluded(request(), draw, always_right, SILENT, tmp_path / "whole") == OK
    concluded(request(trials=3), draw, always_right, SILENT, tmp_path / "parts")
    kept = tmp_path / "parts" / "trials.jsonl"
    # Stopped in the middle of a line, and of the recording of the fourth trial.
    kept.write_text(kept.read_text()[:-25])
    begun = tmp_path / "parts" / "trial_0004" / "campaign"
    begun.mkdir(parents=True)
    (begun / "campaign.csv.gz").write_bytes(b"half")
    (begun / ".seal.json.abcd1_23.part").write_bytes(b"half")
    assert concluded(request(), draw, always_right, SILENT, tmp_path / "parts") == OK
    assert _record(tmp_path / "parts") == _record(tmp_path / "whole")
    assert (tmp_path / "parts/blind.html").read_bytes() == (tmp_path / "whole/blind.html").read_bytes()
    assert kept.read_text() == (tmp_path / "whole/trials.jsonl").read_text()


def test_trials_that_are_there_are_neither_drawn_nor_diagnosed(tmp_path: Path) -> None:
    concluded(request(), draw, always_right, SILENT, tmp_path)
    before = _record(tmp_path)
    assert concluded(request(seed=None), _never, _never, SILENT, tmp_path) == OK
    assert _record(tmp_path) == before


@pytest.mark.slow
def test_a_run_that_goes_on_marks_what_is_there_by_its_own_rules(tmp_path: Path) -> None:
    """Rules of an earlier version gave nothing for what was named; where its files are gone, its marks stay."""
    concluded(request(), draw, always_right, SILENT, tmp_path)
    before, kept = _record(tmp_path), tmp_path / "trials.jsonl"
    assert '"named_right": true' in kept.read_text()
    kept.write_text(kept.read_text().replace('"named_right": true', '"named_right": false'))
    assert concluded(request(), _never, _never, SILENT, tmp_path) == OK
    assert _record(tmp_path) == before
    first, *others = sorted(tmp_path.glob("trial_*/diagnosis.json"))
    first.write_text('{"verdict": {}}')
    for file in others:
        file.unlink()
    assert concluded(request(), _never, _never, SILENT, tmp_path) == NOT_TRUSTED


def test_again_diagnoses_the_same_recordings(tmp_path: Path) -> None:
    concluded(request(), draw, always_right, SILENT, tmp_path)
    code = concluded(request(again=True), _never, always_none, SILENT, tmp_path)
    assert code == NOT_TRUSTED
    record = _record(tmp_path)
    assert record["trials"] == 6
    assert {score["verdict"] for score in record["scores"]} == {"none"}


def test_what_is_reported_is_what_was_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert concluded(request(trials=8), draw, always_right, Reporter(True, False), tmp_path) == OK
    printed = json.loads(capsys.readouterr().out)
    assert printed == _record(tmp_path)
    assert printed["kinds"] == {"none": 2, "effect": 2, "two": 2, "unknown": 2, "foreign": 0}
    rates = {name: (each["count"], each["of"]) for name, each in printed["rates"].items()}
    assert rates["named_right"] == rates["both_named"] == rates["unknown_recognised"] == (2, 2)
    assert rates["located_right"] == (6, 6)
    assert rates["false_alarms"] == (0, 2)
    assert rates["intervals_hold"] == (6, 6)
    assert printed["trusted"] is True
    for name in (
        "confusion.png",
        "confusion.pdf",
        "reliability.png",
        "reliability.pdf",
        "blind.html",
        "trials.jsonl",
    ):
        assert (tmp_path / name).stat().st_size > 300


def test_an_answer_that_was_changed_is_noticed(tmp_path: Path) -> None:
    concluded(request(trials=1), draw, always_right, SILENT, tmp_path)
    path = tmp_path / "trial_0001" / "answer.json"
    path.write_text(path.read_text().replace("accel_lag", "cam_scale"))
    with pytest.raises(InputError, match="not the one that was sealed"):
        concluded(request(trials=1, again=True), _never, always_right, SILENT, tmp_path)


def test_recordings_that_were_changed_are_noticed(tmp_path: Path) -> None:
    concluded(request(trials=2), draw, always_right, SILENT, tmp_path)
    data = [tmp_path / f"trial_000{n}" / "campaign" / "campaign.csv.gz" for n in (1, 2)]
    data[0].write_bytes(data[1].read_bytes())
    with pytest.raises(InputError, match="recordings are not those"):
        concluded(request(trials=1, again=True), _never, always_none, SILENT, tmp_path)


@pytest.mark.parametrize("name", ["mine.txt", "campaign/run.csv", "campaign/seal.json/mine", ".git/config"])
def test_a_folder_that_is_not_a_trials_is_not_removed(name: str, tmp_path: Path) -> None:
    for each in ("trial_0002/campaign/campaign.csv.gz", f"trial_0002/{name}"):
        (tmp_path / each).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / each).write_text("mine")
    top = name.removesuffix("/mine")
    with pytest.raises(
        InputError, match=f"trial_0002: holds {re.escape(top.removesuffix('/config'))}, which is"
    ):
        concluded(request(trials=2), _never, _never, SILENT, tmp_path)
    assert (tmp_path / "trial_0002" / name).read_text() == "mine"


def test_notes_beside_a_recorded_trial_are_left_and_hinder_nobody(tmp_path: Path) -> None:
    concluded(request(trials=1), draw, always_right, SILENT, tmp_path)
    notes = tmp_path / "trial_0001" / "notes.txt"
    notes.write_text("mine")
    assert concluded(request(trials=1, again=True), _never, always_right, SILENT, tmp_path) == OK
    assert notes.read_text() == "mine"


def test_what_is_put_into_a_trials_folder_during_the_run_is_not_removed(tmp_path: Path) -> None:
    mine = tmp_path / "trial_0001" / "mine.txt"

    def disturbed(*given: Any) -> Drawn:
        mine.write_text("mine")
        return draw(*given)

    with pytest.raises(InputError, match=r"holds mine\.txt, which is not of a trial"):
        concluded(request(trials=1), disturbed, _never, SILENT, tmp_path)
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("error", [InputError("no good"), RuntimeError("no good"), KeyError("no good")])
def test_a_diagnosis_that_ends_with_an_error_counts_as_wrong(error: Exception, tmp_path: Path) -> None:
    def broken(*_: object) -> Any:
        raise error

    assert concluded(request(trials=1), draw, broken, SILENT, tmp_path) == NOT_TRUSTED
    (score,) = _record(tmp_path)["scores"]
    assert (score["verdict"], score["named_right"], score["located_right"]) == ("failed", False, False)
    reported = json.loads((tmp_path / "trial_0001" / "diagnosis.json").read_text())
    assert reported["verdict"]["sentence"].startswith(f"{type(error).__name__}: ")
    assert "no good" in reported["verdict"]["sentence"]
    assert any("in broken" in line for line in reported["traceback"])


def test_a_disk_that_is_full_is_no_mark_of_a_diagnosis(tmp_path: Path) -> None:
    def full(*_: object) -> Any:
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        concluded(request(trials=1), draw, full, SILENT, tmp_path)
    assert concluded(request(trials=1), _never, always_right, SILENT, tmp_path) == OK


@pytest.mark.parametrize("other", [request(seed=5), request(every=2), request(shares=(1.0, 1.0, 0.0, 0.0))])
def test_trials_of_other_settings_are_refused(tmp_path: Path, other: BlindRequest) -> None:
    concluded(request(trials=1), draw, always_right, SILENT, tmp_path)
    for again in (False, True):
        with pytest.raises(InputError, match="trials of another"):
            concluded(replace(other, again=again), _never, _never, SILENT, tmp_path)


def test_trials_of_a_rig_that_was_edited_are_refused(tmp_path: Path) -> None:
    mine, given = tmp_path / "mine.toml", default_rig_path().read_text()
    mine.write_text(given)
    concluded(request(trials=1, rig=mine), draw, always_right, SILENT, tmp_path / "out")
    mine.write_text(given.replace("value = 320.0", "value = 321.0"))
    with pytest.raises(InputError, match="trials of another state of the rig file"):
        concluded(request(trials=2, rig=mine), _never, _never, SILENT, tmp_path / "out")


def test_the_rig_is_the_one_that_was_there_when_the_run_began(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(default_rig_path().read_text())

    def edited(*given: Any) -> Drawn:
        mine.write_text("edited")
        return draw(*given)

    code = concluded(request(trials=2, rig=mine), edited, always_right, SILENT, tmp_path / "out")
    assert (code, _record(tmp_path / "out")["trials"]) == (OK, 2)


def test_a_seed_that_nobody_gave_is_another_one_each_time(tmp_path: Path) -> None:
    for name in ("one", "two"):
        concluded(request(trials=1, seed=None), draw, always_right, SILENT, tmp_path / name)
    seeds = {_record(tmp_path / name)["settings"]["seed"] for name in ("one", "two")}
    assert len(seeds) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--trials", "0"), "Invalid value for '--trials'"),
        (("--jobs", "0"), "Invalid value for '--jobs'"),
        (("--seed", "-1"), "Invalid value for '--seed'"),
        (("--every", "0"), "Invalid value for '--every'"),
        (("--shares", "1", "2", "3"), "Option '--shares' requires 4 arguments"),
        (("--shares", "0", "0", "0", "0"), "the shares are 0, 0, 0, 0. Remedy: give four numbers"),
        (("--shares", "1", "-1", "0", "0"), "the shares are 1, -1, 0, 0"),
        (("--foreign", "--shares", "1", "1", "1", "0"), "foreign trials have nothing or one effect"),
        (("--rig", "none.toml"), "none.toml: cannot be read"),
        (("--out", "taken"), "taken: cannot be written"),
        (("--out", "strange"), "trials.jsonl: is no list of trials"),
        (("none.csv",), "none.csv: does not exist"),
        (("none.csv", "--foreign"), "--foreign is of campaigns that are simulated in time"),
        (("none.csv", "--every", "2"), "--every is of campaigns that are simulated in time"),
        (("--plant", "axis"), "trials of axis need a CAMPAIGN whose tests and noise they are to have"),
        (("--max-frequency", "3"), "go with a CAMPAIGN that trials are to be like"),
    ],
)  # fmt: skip
def test_bad_arguments_are_code_2_with_a_reason(
    invoke, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "strange").mkdir()
    (tmp_path / "strange" / "trials.jsonl").write_text("nonsense\n")
    done = invoke("blind", *words)
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.replace("│", " ").split())
    assert done.stdout == ""
    assert "Traceback" not in done.stderr


def test_the_help_says_what_it_writes(invoke) -> None:
    done = invoke("blind", "--help")
    assert done.exit_code == 0
    for word in (
        "Example: savgs-ident blind",
        "Writes",
        "--foreign",
        "--trials",
        "--seed",
        "--jobs",
        "--out",
        "--json",
    ):
        assert word in done.output


def _started(out: Path, trials: int, seconds: float) -> "subprocess.Popen[str]":
    relaxed = {key: value for key, value in os.environ.items() if not key.startswith("JAX_NUMPY_")}
    command = [sys.executable, "-m", "tests.cli.blind_fakes", str(out), str(trials), "2", str(seconds)]
    return subprocess.Popen(
        command, cwd=REPOSITORY, env=relaxed, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def _gone(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    status = Path(f"/proc/{process}/stat")
    return status.exists() and status.read_text().rsplit(")", 1)[1].split()[0] == "Z"


def _all_gone(processes: set[int]) -> bool:
    """Whether processes end within half a minute."""
    for _ in range(300):
        if all(map(_gone, processes)):
            return True
        time.sleep(0.1)
    return False


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_run_leaves_no_process_and_loses_no_trial(tmp_path: Path, how: signal.Signals) -> None:
    stopped, whole = tmp_path / "stopped", tmp_path / "whole"
    with _started(stopped, 6, 1.0) as process:
        assert process.stdout is not None
        workers = {int(process.stdout.readline()) for _ in range(4)}
        process.send_signal(how)
        process.wait(30)
        assert process.returncode in (-how, 130, 1)
        assert _all_gone(workers)
    assert process.pid not in workers
    kept = (stopped / "trials.jsonl").read_text().split("\n")[1:-1]
    assert 1 <= len(kept) < 6
    with _started(stopped, 6, 0.0) as process:
        _, said = process.communicate(timeout=120)
    assert process.returncode == OK, said
    assert concluded(request(), draw, always_right, SILENT, whole) == OK
    assert _record(stopped) == _record(whole)
