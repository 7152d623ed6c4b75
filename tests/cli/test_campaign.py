"""Many campaigns: found and named, identified, resumed, and followed through time."""

import os
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from savgs_ident.campaigns.store import FILES, LONGEST_NAME, find_campaigns, safe_name
from savgs_ident.cli.console import BAD_INPUT, NOT_TRUSTED, OK
from savgs_ident.core import executor
from savgs_ident.core.errors import InputError

from .campaign_fakes import MONDAY, OWN, STDERR, TALKING, campaign_file, never, record_of, rows_of, run

pytestmark = pytest.mark.usefixtures("undrawn")


def test_every_campaign_has_its_row_in_the_order_of_time(week: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run(week, out=out) == OK
    rows = rows_of(out)
    assert [row["name"] for row in rows] == [f"run{10 - day}" for day in range(8)]
    assert list(rows[0]) == [
        "name", "source", "start [UTC]", "status", "reason", "chi2/dof [1]",
        "mu_r [1]", "mu_r stderr [1]", "mu_r own stderr [1]",
        "c_sd [N s/m]", "c_sd stderr [N s/m]", "c_sd own stderr [N s/m]",
    ]  # fmt: skip
    assert rows[0]["start [UTC]"] == "2026-03-02T08:00:00.000Z"
    assert [float(row["mu_r [1]"]) for row in rows] == pytest.approx([3.0 + 0.2 * day for day in range(8)])
    table = pq.read_table(out / "campaigns.parquet").to_pydict()
    assert list(table) == list(rows[0])
    assert table["start [UTC]"][1] == datetime(2026, 3, 3, 8, 0, tzinfo=UTC)
    assert table["mu_r [1]"] == [float(row["mu_r [1]"]) for row in rows]
    for name in ("campaign.png", "campaign.pdf", "campaign.html"):
        assert (out / name).stat().st_size > 1000
    for row in rows:
        assert sorted(path.name for path in (out / row["name"]).iterdir()) == ["done.json", *FILES]


def test_the_trend_is_the_one_that_is_in_the_data(week: Path, tmp_path: Path) -> None:
    run(week, out=tmp_path / "out")
    record = record_of(tmp_path / "out")
    assert (record["order"], record["x"]["unit"], record["x"]["from"]) == (
        "start time",
        "day",
        "2026-03-02T08:00:00.000Z",
    )
    assert record["x"]["values"] == pytest.approx(list(range(8)))
    slope = record["trends"]["mu_r"]["slope"]
    assert (slope["value"], slope["unit"], slope["changes"]) == (pytest.approx(0.2), "1/day", True)
    spread = np.sum((np.arange(8) - 3.5) ** 2)
    assert slope["stderr"] == pytest.approx(STDERR / np.sqrt(spread))
    assert record["trends"]["c_sd"]["slope"]["changes"] is False
    # What the sheet gives wrong is in the variance of c_sd in all campaigns alike.
    mean, share = record["trends"]["c_sd"]["mean"], 1.0 - OWN**2
    assert mean["own_stderr"] == pytest.approx(12.0 * np.sqrt((1.0 - share) / 8.0))
    assert mean["stderr"] == pytest.approx(12.0 * np.sqrt((1.0 - share) / 8.0 + share))
    assert "mu_r changes with time" in record["sentence"]


def test_without_times_the_order_is_that_of_names_with_their_numbers(tmp_path: Path) -> None:
    for number in (10, 2, 1):
        campaign_file(tmp_path / "data" / f"run{number}.csv", 1.0, None if number == 2 else MONDAY + number)
    run(tmp_path / "data", out=tmp_path / "out")
    record = record_of(tmp_path / "out")
    assert [row["name"] for row in record["campaigns"]] == ["run1", "run2", "run10"]
    assert (record["order"], record["x"]["unit"], record["x"]["values"]) == (
        "name",
        "campaign",
        [1.0, 2.0, 3.0],
    )
    assert "Only 2 of 3 recordings say when they began" in record["notes"][0]


def test_campaigns_that_scatter_widen_the_errors_and_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = 3.0 + np.array([1.0, -1.0, 0.9, -0.8, 1.1, -1.2])
    for number, value in enumerate(values):
        campaign_file(tmp_path / "data" / f"run{number}.csv", value)
    run(tmp_path / "data", out=tmp_path / "out", reporter=TALKING)
    trend = record_of(tmp_path / "out")["trends"]["mu_r"]
    assert trend["scatters"] is True
    assert trend["mean"]["chi2"] == pytest.approx(np.sum((values - values.mean()) ** 2) / STDERR**2)
    assert trend["slope"]["widening"] > 8.0
    assert trend["slope"]["changes"] is False
    said = capsys.readouterr().out
    assert "mu_r scatters more than the errors say" in said
    assert "c_sd scatters" not in said


def test_a_failed_campaign_is_reported_and_the_rest_is_finished(
    week: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign_file(week / "bad.csv", 0.0, failure="ValueError: no good")
    campaign_file(week / "vague.csv", 900.0, MONDAY, trusted=False)
    out = tmp_path / "out"
    assert run(week, out=out) == NOT_TRUSTED
    said = capsys.readouterr().err.splitlines()
    assert "Failed: bad: ValueError: no good" in said
    assert "Not to be trusted: vague: the data do not identify every free parameter." in said
    assert said[-1].startswith("1 of 10 campaigns failed and 1 of 10 campaigns is not to be trusted")
    record = record_of(out)
    assert record["counts"] == {"ok": 8, "not trusted": 1, "failed": 1}
    assert record["campaigns"][-1]["name"] == "bad"
    assert record["trends"]["mu_r"]["campaigns"] == 8
    assert record["trends"]["mu_r"]["slope"]["value"] == pytest.approx(0.2)
    assert not (out / "bad").exists()


def test_nothing_readable_is_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in "ab":
        campaign_file(tmp_path / "data" / f"{name}.csv", 0.0, failure="no column is known", unreadable=True)
    assert run(tmp_path / "data", out=tmp_path / "out") == BAD_INPUT
    assert "Error: no campaign could be read." in capsys.readouterr().err
    assert record_of(tmp_path / "out")["counts"]["failed"] == 2


def test_names_are_unique_and_every_file_system_takes_them(tmp_path: Path) -> None:
    hostile = (
        "..csv", "a\nb\x1b[31m.csv", "CON.csv", "x" * 240 + ".csv", "é" * 110 + ".csv", "campaign.html.csv",
        "=cmd().csv", "<b>.csv", "$(rm -rf ~).csv", os.fsdecode(b"\xff\xfe.csv"), "-rf.csv", "NAME.csv",
    )  # fmt: skip
    for number, name in enumerate(hostile):
        campaign_file(tmp_path / "data" / name, float(number))
    for folder in ("one", "two"):
        campaign_file(tmp_path / folder / "name.csv", 5.0)
    folders = [tmp_path / each for each in ("data", "one", "two")]
    out = tmp_path / "out"
    assert run(*folders, out=out) == OK
    names = [row["name"] for row in record_of(out)["campaigns"]]
    assert len({name.casefold() for name in names}) == len(hostile) - 1 + 2
    for name in names:
        assert name == safe_name(name)
        assert len(name.encode()) <= LONGEST_NAME + 13
        assert (out / name / "done.json").is_file()
    assert {"one_name", "two_name", "data_NAME"} <= set(names)
    assert run(*reversed(folders), out=out, work=never) == OK
    page = (out / "campaign.html").read_text()
    assert "<b>" not in page
    assert "\x1b" not in page


def test_files_named_after_tests_are_one_campaign_others_one_each(tmp_path: Path) -> None:
    for name in (
        "a/dwell_2.0Hz.csv", "a/standstill.csv", "b/rig.csv", "b/other.mcap", "b/sub/more.csv.gz",
        "b/.hidden/x.csv", "b/empty/readme.md", "b/out/campaigns.csv", "b/out/campaign.json",
    ):  # fmt: skip
        campaign_file(tmp_path / name, 1.0)
    found = find_campaigns([tmp_path / "a", tmp_path / "b", tmp_path / "b" / "rig.csv"])
    assert [str(each.path.relative_to(tmp_path)) for each in found] == [
        "a",
        "b/other.mcap",
        "b/rig.csv",
        "b/sub",
    ]
    assert [each.name for each in find_campaigns([tmp_path / "b" / "sub" / "more.csv.gz"])] == ["more"]


def test_results_among_the_recordings_are_not_read_as_recordings(week: Path, tmp_path: Path) -> None:
    for name in ("first", "second", "first"):
        assert run(week, out=week / name) == OK
        assert len(rows_of(week / name)) == 8
    # As an earlier version took it.
    for result in (week / "first").glob("campaign*.*"):
        result.rename(week / result.name)
    assert len(find_campaigns([week])) == 8


@pytest.mark.parametrize(
    ("arguments", "out"),
    [
        (("data",), "data"),
        (("data",), "data/../data"),
        (("data",), "data/b"),
        (("data/b",), "data"),
        (("data/campaigns.csv",), "data"),
    ],
)
def test_results_do_not_get_among_the_recordings(
    arguments: tuple[str, ...], out: str, tmp_path: Path
) -> None:
    for name in ("a.csv", "campaigns.csv", "b/dwell_2.0Hz.csv", "b/fit.json", "b/model.toml"):
        campaign_file(tmp_path / "data" / name, 1.0)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"is where recordings are read.*Remedy: name another folder: --out"):
        run(*(tmp_path / each for each in arguments), out=tmp_path / out, work=never)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_the_same_data_twice_is_noticed(tmp_path: Path) -> None:
    for name in ("first", "second"):
        campaign_file(tmp_path / "data" / f"{name}.csv", 1.0)
    run(tmp_path / "data", out=tmp_path / "out")
    assert "second holds the same data as first: they count twice." in record_of(tmp_path / "out")["notes"]


@pytest.mark.parametrize("start", [MONDAY, None])
def test_one_campaign_has_neither_trend_nor_order(start: float | None, tmp_path: Path) -> None:
    path = campaign_file(tmp_path / "only.csv", 1.0, start)
    assert run(path, out=tmp_path / "out") == OK
    record = record_of(tmp_path / "out")
    assert record["trends"]["mu_r"]["slope"] is None
    assert record["notes"] == []
    assert "<p></p>" not in (tmp_path / "out" / "campaign.html").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "Missing argument"),
        (("none",), "none: does not exist"),
        (("empty",), "empty: the folder holds no campaign"),
        (("data", "--free", "magic"), "there is no parameter 'magic'"),
        (("data", "--rig", "none.toml"), "none.toml: cannot be read"),
        (("data", "--channels", "none.toml"), "none.toml"),
        (("data", "--out", "data/a.csv"), "data/a.csv: is where recordings are read"),
        (("data", "--workers", "0"), "Invalid value for '--workers'"),
        (("data", "--scheduler", "tcp://127.0.0.1:1"), "the Dask scheduler at tcp://127.0.0.1:1 does not answer"),
    ],
)  # fmt: skip
def test_bad_arguments_are_code_2_with_a_reason(
    invoke: Any, tmp_path: Path, words: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executor, "ANSWER_S", 0.5)
    (tmp_path / "empty").mkdir()
    campaign_file(tmp_path / "data" / "a.csv", 1.0)
    began = time.monotonic()
    done = invoke("campaign", *words)
    assert time.monotonic() - began < 30.0
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.replace("│", " ").split())
    assert "Traceback" not in done.stderr


def test_dask_that_is_not_installed_is_reported_with_the_remedy(
    invoke: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    campaign_file(tmp_path / "data" / "a.csv", 1.0)
    done = invoke("campaign", "data", "--scheduler", "tcp://127.0.0.1:1")
    assert done.exit_code == 2
    assert "Remedy: pip install 'savgs-ident[cluster]'." in " ".join(done.stderr.split())
