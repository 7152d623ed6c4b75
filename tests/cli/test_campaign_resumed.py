"""Many campaigns: what is done is kept, what is not whole, not the same or not readable is not."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from savgs_ident import __version__
from savgs_ident.campaigns.run import identify_one
from savgs_ident.cli.console import BAD_INPUT, OK
from savgs_ident.fit.least_squares import FitSettings

from .campaign_fakes import TALKING, campaign_file, never, read_number, request, rows_of, run

pytestmark = pytest.mark.usefixtures("undrawn")

QUICK: dict[str, Any] = {
    "free": ("c_sd",),
    "max_frequency": 1.5,
    "settings": FitSettings(orders=3, fixed_tolerances=True),
}


def _part(path: Path, *names: str, age: float = 3600.0) -> Path:
    """A folder with these files in it, or a file where there are none, that was left so long ago [s]."""
    if names:
        path.mkdir()
        for name in names:
            (path / name).write_text("half")
    else:
        path.write_text("half")
    os.utime(path, 2 * (time.time() - age,))
    return path


def test_a_second_run_keeps_what_is_done_and_says_so(
    week: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    run(week, out=out)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert run(week, out=out, work=never, reporter=TALKING) == OK
    assert "8 campaigns identified in an earlier run" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def _lost(path: Path) -> None:
    (path / "model.toml").unlink()


def _cut(path: Path) -> None:
    (path / "fit.json").write_bytes((path / "fit.json").read_bytes()[:-10])


def _unsealed(path: Path) -> None:
    (path / "done.json").write_text("{")


@pytest.mark.slow
@pytest.mark.parametrize("harm", [_lost, _cut, _unsealed])
def test_what_is_not_whole_is_done_anew(week: Path, tmp_path: Path, harm: Callable[[Path], None]) -> None:
    out, seen = tmp_path / "out", []
    run(week, out=out)
    _part(out / ".run3.x.part", "fit.json")
    (out / "run3" / "mine.txt").write_text("not to be touched")
    harm(out / "run3")

    def counting(task: Any) -> Any:
        seen.append(task.request.campaign.name)
        return read_number(task)

    assert run(week, out=out, work=counting) == OK
    assert seen == ["run3.csv"]
    assert (out / "run3" / "mine.txt").exists()
    assert not list(out.glob(".*"))
    assert run(week, out=out, work=never) == OK


def test_only_own_parts_that_nobody_writes_are_removed(week: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / ".empty.part").mkdir()
    os.utime(out / ".empty.part", (0.0, 0.0))
    others = {
        out / ".empty.part",
        _part(out / ".theirs.part"),
        _part(out / ".campaign.json.backup.part"),
        _part(out / ".run2.x.part", "fit.json", "mine.txt"),
        _part(out / ".run3.x.part", "fit.json", "fit.json.mine"),
        _part(out / ".run4.x.part", "fit.json", age=1.0),
        _part(out / ".campaigns.csv.abcd1_23.part", age=1.0),
    }
    _part(out / ".run5.x.part", "fit.json", "done.json")
    _part(out / ".campaign.json.abcd1_23.part")
    run(week, out=out)
    assert {*out.glob(".*")} == others


@pytest.mark.slow
def test_other_settings_another_rig_and_other_data_are_done_anew(
    week: Path, tmp_path: Path, rig: Any
) -> None:
    out = tmp_path / "out"
    mine = tmp_path / "mine.toml"
    given = request().one.rig.read_text()
    mine.write_text(given)
    seen: list[str] = []

    def counting(task: Any) -> Any:
        seen.append(task.request.campaign.name)
        return read_number(task)

    def again(**changes: Any) -> int:
        seen.clear()
        run(week, out=out, work=counting, **changes)
        return len(seen)

    assert [again(), again(), again(rig=mine)] == [8, 0, 0]
    assert again(max_frequency=4.0) == 8
    assert again(settings=FitSettings(orders=5)) == 8
    assert again(free=("mu_r",)) == 8
    mine.write_text(given.replace("value = 320.0", "value = 321.0"))
    assert [again(rig=mine), again(rig=mine)] == [8, 0]
    campaign_file(week / "run5.csv", 1.0)
    assert again(rig=mine) == 1
    (week / "channels.toml").write_text("")
    assert again(rig=mine) == 8


@pytest.mark.slow
def test_a_campaign_that_cannot_be_read_is_a_failure_in_one_line(tmp_path: Path) -> None:
    path = campaign_file(tmp_path / "a.csv", 1.0)
    seen: list[Any] = []

    def real(task: Any) -> Any:
        seen.append(identify_one(task))
        return seen[-1]

    assert run(path, out=tmp_path / "out", work=real) == BAD_INPUT
    assert seen[0].unreadable
    assert "\n" not in seen[0].reason
    assert str(path) in seen[0].reason


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"data_sha256": "0" * 64}, "is not what it was when the run began"),
        ({"channels_sha256": "0" * 64}, "the map of its channels is not what it was when the run began"),
        ({"version": "0.0"}, f"a worker has version {__version__} of savgs-ident, the run began with 0.0"),
    ],
)
def test_what_changed_during_the_run_is_not_kept(
    short_campaign: Path, tmp_path: Path, change: dict[str, str], said: str
) -> None:
    def late(task: Any) -> Any:
        return identify_one(replace(task, **change))

    out = tmp_path / "out"
    assert run(short_campaign, out=out, work=late, **QUICK) == BAD_INPUT
    assert said in rows_of(out)[0]["reason"]
    assert not list(out.glob("*/done.json"))


def test_a_map_that_is_put_beside_the_recordings_during_the_run_is_noticed(
    short_campaign: Path, tmp_path: Path
) -> None:
    data = tmp_path / "data" / "short.csv"
    data.parent.mkdir()
    data.symlink_to(short_campaign)

    def late(task: Any) -> Any:
        (data.parent / "channels.toml").write_text("")
        return identify_one(task)

    assert run(data, out=tmp_path / "out", work=late, **QUICK) == BAD_INPUT
    assert "the map of its channels is not what it was" in rows_of(tmp_path / "out")[0]["reason"]


def test_ctrl_c_is_code_130_and_keeps_what_is_done(
    invoke: Any, week: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
        yield 0, read_number(tasks[0])
        raise KeyboardInterrupt

    monkeypatch.setattr("savgs_ident.campaigns.run.spread_of", lambda _: stopped)
    done = invoke("campaign", week, "--out", "out")
    assert done.exit_code == 130
    assert done.stderr.endswith("Stopped by Ctrl-C; files that were finished are kept.\n")
    assert len(list((tmp_path / "out").glob("*/done.json"))) == 1
