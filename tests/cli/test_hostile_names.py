"""Names that nobody should give to a file, a test, a column, a topic or a rig: shown as they are, never obeyed."""

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from mcap.writer import Writer

from savgs_ident.plants.quarter_car.rig import default_rig_path

from ..report.page_reader import Reader
from .conftest import Program
from .installed import Installed, files_in

FILES = (
    b"<script>alert(1)<script>[bold red].csv",
    b"\xff\xfe\xed\xa0\x80.csv",
    b"[bold red]run[link=x].csv",
    b"two\nlines\x1b[31m\x1b]0;title\x07.csv",
    b"..%2f..%2fx.csv",
    b"-rf.csv",
    b"x" * 240 + b".csv",
)
TESTS = (
    "<script>alert(1)</script>_2Hz",
    "../../../escaped_2Hz",
    "two\nlines\x1b[31m_2Hz",
    "[bold red]_[/bold red][/]_2Hz",
    "y" * 5000 + "_2Hz",
)
EVIL = "<script>alert(1)</script><img src=x onerror=alert(2)>[bold]\"'&\x1b[31m../../x"

TOPICS = (EVIL, "/" + "t" * 5000, "two\nlines\x1b[31m")

STARTED = 1
"""So many names of each kind are given to the installed program, the others to the same commands in this process."""

Started = Callable[[int], Program]


@pytest.fixture
def started(installed: Installed, inside: Program) -> Started:
    """What runs the program for the name at some place among those of its kind."""

    def as_process(*words: object) -> "subprocess.CompletedProcess[str]":
        return installed.run(*words, LC_ALL="C.UTF-8")

    return lambda place: as_process if place < STARTED else inside


def _sound(text: str) -> None:
    assert "\x1b" not in text
    assert "Traceback" not in text


def _harmless(page: Path) -> None:
    """A page without a script or an attribute that is one, in which the name stands as text."""
    reader = Reader(page.read_text("utf-8"))
    assert "script" not in {tag for tag, _ in reader.tags}
    assert not [name for _, attributes in reader.tags for name in attributes if name.startswith("on")]
    assert any("<script>alert(1)" in text for text in reader.texts)


@pytest.mark.slow
@pytest.mark.parametrize("place", range(len(FILES)))
def test_a_file_of_any_name_is_read_and_nothing_is_written_elsewhere(
    started: Started, short_campaign: Path, tmp_path: Path, place: int
) -> None:
    """Its text names the file, as does its JSON: one each for half of the names."""
    name = os.fsdecode(FILES[place])
    shutil.copy(short_campaign, tmp_path / name)
    more = ("--json",) if place % 2 else ()
    done = started(place)("inspect", "--out", "o", *more, f"./{name}")
    assert done.returncode == 0, done.stderr
    _sound(done.stdout + done.stderr)
    assert done.stderr.splitlines()[1:] == ["estimating responses", "drawing"]
    record = json.loads((tmp_path / "o" / "inspect.json").read_text("utf-8"))
    assert record["source"] == name
    assert files_in(tmp_path) == sorted([name, "o/inspect.json", "o/inspect.pdf", "o/inspect.png"])


@pytest.mark.slow
@pytest.mark.parametrize("place", range(len(TESTS)))
def test_a_test_and_a_column_of_any_name(
    started: Started, short_campaign: Path, tmp_path: Path, place: int
) -> None:
    table = pd.read_csv(short_campaign)
    table["test"] = table["test"].replace({"dwell_2.35Hz": TESTS[place]})
    table[f"{TESTS[place]} [m]"] = 0.0
    table.to_csv(tmp_path / "run.csv", index=False)
    done = started(place)("inspect", "run.csv", "--out", "o")
    assert done.returncode in (0, 2)
    _sound(done.stdout + done.stderr)
    assert set(files_in(tmp_path)) <= {
        "run.csv", "o/inspect.json", "o/inspect.pdf", "o/inspect.png"
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("place", range(len(TOPICS)))
def test_a_topic_of_any_name(started: Started, tmp_path: Path, place: int) -> None:
    topic = TOPICS[place]
    with (tmp_path / "run.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(topic, "json", 0)
        for number in range(3):
            writer.add_message(channel, 10**9 * number, json.dumps({topic: 1.0}).encode(), 10**9 * number)
        writer.finish()
    done = started(place)("inspect", "run.mcap", "--out", "o", "--quiet")
    assert done.returncode == 2
    _sound(done.stderr)
    (line,) = done.stderr.splitlines()
    assert line.startswith("Error: run.mcap")
    assert files_in(tmp_path) == ["run.mcap"]


@pytest.mark.slow
def test_an_identified_rig_remembers_any_name(installed: Installed, short_campaign: Path) -> None:
    quick = ("--free", "c_sd", "--max-frequency", "2", "--fixed-tolerances", "--quiet")
    name = FILES[1]
    shutil.copy(short_campaign, installed.folder / os.fsdecode(name))
    done = installed.run("fit", *quick, "--out", "o", b"./" + name)
    # The damping alone does not explain the recordings; the model is written, and exported, all the same.
    assert (done.returncode, done.stdout) == (1, "")
    assert "the model does not explain the data" in done.stderr
    again = installed.run("export", "o/model.toml", "--to", "json", "--out", "e", "--quiet")
    assert again.returncode == 1
    assert "the rig file's own fit is not to be trusted" in again.stderr.lower()
    assert {path.name for path in installed.folder.iterdir()} == {os.fsdecode(name), "o", "e"}


@pytest.mark.slow
def test_the_report_on_campaigns_shows_their_names(installed: Installed, short_campaign: Path) -> None:
    data = installed.folder / "data"
    data.mkdir()
    for name in FILES[:4]:
        shutil.copy(short_campaign, data / os.fsdecode(name))
    quick = ("--free", "c_sd", "--max-frequency", "2", "--fixed-tolerances", "--workers", "1")
    done = installed.run("campaign", data, *quick, "--out", "o")
    assert done.returncode == 1, done.stderr
    assert "the model does not explain the data" in done.stderr
    _sound(done.stdout + done.stderr)
    _harmless(installed.folder / "o" / "campaign.html")
    assert {path.name for path in installed.folder.iterdir()} == {"data", "o"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "page"),
    [
        (("linearise",), "linearise.html"),
        (("design", "--rigs", "1"), "design.html"),
        (("simulate", "--frequency", "2"), None),
        (("export", "--to", "json", "mat", "python-control", "casadi", "c"), None),
    ],
)
def test_a_rig_of_any_name(inside: Program, tmp_path: Path, words: tuple[str, ...], page: str | None) -> None:
    text = default_rig_path().read_text("utf-8")
    assert 'name = "gt_rear"' in text
    rig = tmp_path / "rig.toml"
    rig.write_text(text.replace('name = "gt_rear"', f"name = {json.dumps(EVIL)}", 1), "utf-8")
    done = inside(*words[:1], "rig.toml", *words[1:], "--out", "o")
    assert done.returncode == 0, done.stderr
    _sound(done.stdout + done.stderr)
    if page is not None:
        _harmless(tmp_path / "o" / page)
    assert {path.name for path in tmp_path.iterdir()} == {"rig.toml", "o"}
