"""Disks that are full and folders that refuse: the file is named, the code is 2, and no half of a file is left."""

import json
from pathlib import Path

import pytest

from savgs_ident.core import files
from savgs_ident.core.errors import InputError
from savgs_ident.core.files import scratch_folder
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig

from .command_rows import ROWS, words_of
from .conftest import Program
from .installed import Installed, files_in, on_a_disk_with

RIG = default_rig_path()
QUICK = ("--free", "c_sd", "--max-frequency", "2", "--fixed-tolerances")
FAST = ("inspect", "export")


def _slow_but(name: str) -> tuple[pytest.MarkDecorator, ...]:
    return () if name in FAST else (pytest.mark.slow,)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "more", "room", "refused", "kept"),
    [
        ("inspect", (), 30_000, "inspect.png", ["inspect.json"]),
        ("simulate", ("--frequency", "2"), 20_000, "simulate.png", ["simulate.csv", "simulate.json"]),
        ("fit", QUICK, 30_000, "bode.png", ["fit.json", "model.toml"]),
        ("campaign", (*QUICK, "--workers", "1"), 1_000, "o/short", []),
    ],
)
def test_a_full_disk_is_reported_with_the_file_and_leaves_whole_files_only(
    installed: Installed,
    short_campaign: Path,
    name: str,
    more: tuple[str, ...],
    room: int,
    refused: str,
    kept: list[str],
) -> None:
    words = (name, *more, *words_of(name, short_campaign, RIG), "--quiet", "--out", "o")
    done = installed.run(*words, before=on_a_disk_with(room))
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert f"{refused}: cannot be written: File too large" in line
    assert "--out DIR" in line
    assert files_in(installed.folder / "o") == kept
    for file in kept:
        if file.endswith(".json"):
            assert json.loads((installed.folder / "o" / file).read_text())
        elif file.endswith(".toml"):
            read_rig(installed.folder / "o" / file)


@pytest.mark.parametrize("name", [pytest.param(name, marks=_slow_but(name)) for name in ROWS])
@pytest.mark.parametrize("out", ["taken", "taken/below", "/proc/nowhere/below"])
def test_an_output_folder_that_cannot_be_is_reported_before_any_work(
    inside: Program, tmp_path: Path, short_campaign: Path, name: str, out: str
) -> None:
    (tmp_path / "taken").write_text("mine")
    done = inside(name, *words_of(name, short_campaign, RIG), "--out", out)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"Error: {out}: cannot be written: ")
    assert line.endswith("--out DIR.")
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.parametrize("home", ["taken", "/proc/nowhere"])
def test_without_a_home_and_a_cache_the_program_works(installed: Installed, home: str) -> None:
    (installed.folder / "taken").write_text("mine")
    words = ("simulate", RIG, "--frequency", "2", "--out", "o", "--quiet", "--json")
    done = installed.run(*words, HOME=home, SAVGS_IDENT_CACHE=home, MPLCONFIGDIR=str(installed.folder))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (installed.folder / "o" / "simulate.json").read_text()
    assert (installed.folder / "taken").read_text() == "mine"


@pytest.mark.slow
def test_a_full_cache_is_no_concern_of_the_user(installed: Installed) -> None:
    words = ("simulate", RIG, "--frequency", "2", "--out", "o", "--quiet")
    folder = str(installed.folder / "cache")
    cut = installed.run(*words, before=on_a_disk_with(300), SAVGS_IDENT_CACHE=folder)
    assert cut.returncode == 2
    (line,) = cut.stderr.splitlines()
    assert "simulate.json: cannot be written" in line
    # Halves of programs are in the cache now.
    assert any(path.stat().st_size == 300 for path in Path(folder).iterdir())
    done = installed.run(*words, SAVGS_IDENT_CACHE=folder)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_temporary_folder_without_room_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "_LEAST_FREE_SPACE", 1 << 62)
    with pytest.raises(InputError, match=r"the disk is full\. Remedy: .*TMPDIR"), scratch_folder():
        pass
