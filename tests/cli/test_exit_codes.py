"""Every command of the installed program: its exit codes, and the one line in which it says what is wrong.

What they compute has tests of its own. Those that take long are run to their end there only, in this process:
posterior, calibrate, false-alarms, blind, linearise, design and closed-loop.
"""

import json
import subprocess
from itertools import permutations
from pathlib import Path

import pytest

from savgs_ident.cli.options import spread_values
from savgs_ident.plants.quarter_car.rig import default_rig_path

from ..in_one_test import over
from .command_rows import ASKING, COMMANDS, READING, ROWS, words_of
from .conftest import Program
from .installed import Installed, files_in

RIG = default_rig_path()
QUICK = ("--free", "c_sd", "--max-frequency", "2", "--fixed-tolerances")
LIGHT = ("inspect", "bode", "simulate", "export")


def _refused(done: "subprocess.CompletedProcess[str]", named: str) -> str:
    """The last line of a refusal, after checks that it is one; ``named`` is what it has to name."""
    *before, line = done.stderr.splitlines()
    assert done.returncode == 2
    assert done.stdout == ""
    assert line.startswith("Error: ")
    assert "Remedy: " in line
    # Of many campaigns, each says by itself what is wrong with it.
    assert all(each.startswith("Failed: ") for each in before)
    assert named in "".join((*before, line))
    return line


def test_every_command_has_its_row() -> None:
    assert set(ROWS) == set(COMMANDS)


def test_without_a_command_the_help_is_shown_and_the_code_is_2(inside: Program) -> None:
    done = inside()
    assert (done.returncode, done.stderr) == (2, "")
    assert "closed-loop" in done.stdout


@over("name", ROWS)
def test_help_is_code_0_and_an_unknown_option_code_2(inside: Program, name: str) -> None:
    asked = inside(name, "--help")
    assert (asked.returncode, asked.stderr) == (0, "")
    assert f"savgs-ident {name}" in asked.stdout
    line = _refused(inside(name, "--nonsense"), "--nonsense")
    assert line.endswith(f"Remedy: see savgs-ident {name} --help.")


@over("name", ASKING)
def test_without_its_argument_a_command_is_code_2(inside: Program, name: str) -> None:
    line = _refused(inside(name), "Missing argument '")
    assert line.endswith(f"Remedy: see savgs-ident {name} --help.")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("demo", "two\nlines\x1b[31m"),
            r"(two\x0alines\x1b[31m). Remedy: see savgs-ident demo --help.",
        ),
        (
            ("inspect", "two\nlines\x1b[31m", "--quiet"),
            r"Error: two\nlines\x1b[31m: does not exist. Remedy: check the path.",
        ),
    ],
)  # fmt: skip
def test_what_was_typed_is_reported_in_one_line(inside: Program, words: tuple[str, ...], said: str) -> None:
    done = inside(*words)
    assert _refused(done, "").endswith(said)
    assert "\x1b" not in done.stderr


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in LIGHT else pytest.mark.slow) for name in READING],
)
def test_a_file_of_the_wrong_kind_is_code_2(inside: Program, tmp_path: Path, name: str) -> None:
    picture = tmp_path / "picture.csv"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    _refused(inside(name, *words_of(name, picture, picture), "--quiet"), "picture")
    written = {Path(path).name for path in files_in(tmp_path / "out")}
    # Many campaigns have a report even if each of them failed.
    assert written <= (
        {"campaign.html", "campaign.json", "campaigns.csv", "campaigns.parquet"}
        if name == "campaign"
        else set()
    )


@pytest.mark.parametrize("name", ROWS)
def test_words_mean_the_same_in_any_order(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    words = words_of(name, "a.csv", "b.toml")
    files = [word for word in words if word in ("a.csv", "b.toml")]
    files = [] if name in ("blind", "plan") else files
    rest = [tuple(words[len(files) :])] if words[len(files) :] else []
    several = [("--free", "mu_r", "c_sd")] if name in ("fit", "campaign") else []
    options = [*rest, *several, ("--out", "o"), ("--json",), ("--quiet",)]
    meanings = set()
    for order in permutations([*(("",) for _ in files), *options]):
        waiting = iter(files)
        line = [word or next(waiting) for group in order for word in group]
        context = COMMANDS[name].make_context(name, spread_values(line))
        meanings.add(repr(sorted(context.params.items())))
    (meaning,) = meanings
    for file in files:
        assert file in meaning
    assert "('quiet', True)" in meaning


@pytest.mark.slow
def test_options_before_and_after_the_argument_give_the_same_result(
    inside: Program, short_campaign: Path
) -> None:
    before = inside("inspect", "--json", "--quiet", "--out", "a", short_campaign)
    after = inside("inspect", short_campaign, "--out", "b", "--quiet", "--json")
    assert (before.returncode, before.stderr) == (after.returncode, after.stderr) == (0, "")
    assert before.stdout == after.stdout
    assert json.loads(before.stdout)["dwells"]
    for name in ("inspect.json", "inspect.png", "inspect.pdf"):
        assert Path("a", name).read_bytes() == Path("b", name).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "more", "record", "code"),
    [
        ("demo", (), "fit.json", 0),
        ("inspect", (), "inspect.json", 0),
        # The damping alone, with all else as on the sheet, does not explain the recordings.
        ("fit", QUICK, "fit.json", 1),
        ("bode", (), "bode.json", 0),
        ("simulate", ("--frequency", "2"), "simulate.json", 0),
        ("diagnose", ("--max-frequency", "2.5", "--orders", "3"), "diagnosis.json", 0),
        ("export", (), "export.json", 0),
        ("campaign", QUICK, "campaign.json", 1),
    ],
)
def test_work_that_is_done_is_code_0_or_1_and_json_is_alone_on_standard_output(
    installed: Installed, short_campaign: Path, name: str, more: tuple[str, ...], record: str, code: int
) -> None:
    words = words_of(name, short_campaign, RIG)
    done = installed.run(name, *more, *words, "--json", "--quiet", "--out", "o")
    assert done.returncode == code, done.stderr
    assert done.stdout == (installed.folder / "o" / record).read_text("utf-8")
    assert json.loads(done.stdout)
    assert bool(done.stderr) == bool(code)
    assert "Traceback" not in done.stderr
    assert code == 0 or "ot to be trusted" in done.stderr.splitlines()[-1]
    assert not [name for name in files_in(installed.folder / "o") if name.endswith(".part")]
