"""Standard output and standard error closed, full, left early or without Unicode: the code stays what it is."""

import json
from pathlib import Path

import pytest

from .installed import Installed, files_in

WRITTEN = ["inspect.json", "inspect.pdf", "inspect.png"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        '"$@" | head -1; exit ${PIPESTATUS[0]}',
        '"$@" 2>&1 | true; exit ${PIPESTATUS[0]}',
        '"$@" >&- 2>&-',
        '"$@" 2>/dev/full',
    ],
)
def test_nobody_who_listens_is_no_reason_to_stop(
    installed: Installed, short_campaign: Path, line: str
) -> None:
    done = installed.shell(line, "inspect", short_campaign, "--out", "o")
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr
    assert files_in(installed.folder / "o") == WRITTEN


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ('"$@" | true; exit ${PIPESTATUS[0]}', 2),
        pytest.param('"$@" 2>&1 | true; exit ${PIPESTATUS[0]}', 2, marks=pytest.mark.slow),
        ('"$@" >&- 2>&-', 2),
        ('"$@" --help | true; exit ${PIPESTATUS[0]}', 0),
        ('"$@" --help >&-', 0),
    ],
)
def test_nobody_who_listens_changes_no_code(installed: Installed, line: str, code: int) -> None:
    done = installed.shell(line, "inspect", "none.csv")
    assert done.returncode == code
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("inspect", "--help"),
        pytest.param(("inspect", "{campaign}"), marks=pytest.mark.slow),
        pytest.param(("inspect", "{campaign}", "--json"), marks=pytest.mark.slow),
    ],
)
def test_a_full_disk_under_standard_output_is_reported(
    installed: Installed, short_campaign: Path, words: tuple[str, ...]
) -> None:
    done = installed.shell('"$@" >/dev/full', *(word.format(campaign=short_campaign) for word in words))
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == (
        "Error: standard output: No space left on device. Remedy: check the path, its permissions, the disk."
    )
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "reported",
    [
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "latin-1", "NO_COLOR": "1", "COLUMNS": "20"},
    ],
)
def test_without_unicode_tables_are_spelled_out(
    installed: Installed, short_campaign: Path, reported: dict[str, str]
) -> None:
    campaign = installed.folder / "Prüfstand.csv"
    campaign.symlink_to(short_campaign)
    shown = installed.run("inspect", campaign, "--out", "o", **reported)
    assert shown.returncode == 0, shown.stderr
    assert "Written: o/inspect.json" in shown.stdout
    assert "²" not in shown.stdout


@pytest.mark.slow
def test_without_unicode_json_is_what_it_is(installed: Installed, short_campaign: Path) -> None:
    campaign = installed.folder / "Prüfstand.csv"
    campaign.symlink_to(short_campaign)
    handed = installed.run("inspect", campaign, "--out", "o", "--json", PYTHONIOENCODING="ascii")
    assert handed.returncode == 0, handed.stderr
    assert handed.stdout == (installed.folder / "o" / "inspect.json").read_text("utf-8")
    assert json.loads(handed.stdout)["source"].endswith("fstand.csv")


@pytest.mark.parametrize("columns", ["1", "20", "nonsense"])
def test_a_narrow_terminal_gets_the_whole_help(installed: Installed, columns: str) -> None:
    done = installed.run("fit", "--help", COLUMNS=columns, NO_COLOR="1", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")
    assert "\x1b" not in done.stdout
    assert done.stdout.isascii()
