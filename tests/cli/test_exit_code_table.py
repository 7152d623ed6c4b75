"""docs/exit-codes.md against the program: a row for each command, the words of its help, and what it really says."""

import re
from pathlib import Path

from ..in_one_test import over
from .command_rows import COMMANDS
from .conftest import Program

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "exit-codes.md").read_text("utf-8")


def _rows(heading: str) -> dict[str, str]:
    """The two columns of the table under a heading."""
    section = PAGE.split(f"## {heading}\n")[1].split("\n## ")[0]
    return dict(re.findall(r"^\| `(.+?)` \| (.+) \|$", section, re.MULTILINE))


SAID = _rows("What 2 says")


def _code_1_in_help(name: str) -> str:
    reported = " ".join((COMMANDS[name].help or "").split())
    found = re.search(r"Exit code 1 if (.+?)\. Example:", reported)
    return found[1] if found else "never"


def test_every_command_is_in_both_tables() -> None:
    assert list(_rows("What 1 means")) == list(COMMANDS)
    assert {typed.split()[0] for typed in SAID} >= set(COMMANDS)


@over("name", COMMANDS)
def test_what_1_means_is_what_the_help_says(name: str) -> None:
    assert _rows("What 1 means")[name] == _code_1_in_help(name)


def test_the_codes_are_those_of_the_help_of_the_program(inside: Program) -> None:
    reported = " ".join(inside("--help").stdout.split())
    listed = re.search(r"Exit codes: (.+?stopped)", reported)
    assert listed is not None
    assert re.findall(r"(\d+) ", listed[1]) == re.findall(r"^\| (\d+) \|", PAGE, re.MULTILINE)


@over("typed", SAID)
def test_a_missing_file_is_one_line_with_a_remedy_and_code_2(inside: Program, typed: str) -> None:
    name, *rest = typed.split()
    done = inside(name, "--quiet", *rest)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"{SAID[typed]}\n")
