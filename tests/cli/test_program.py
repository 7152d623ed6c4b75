"""The program as a process: what it answers at once, what it loads, how it ends."""

import json
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from savgs_ident import __version__

from ..in_one_test import over

COMMAND = (sys.executable, "-m", "savgs_ident.cli")
COMMANDS = (
    "demo", "inspect", "fit", "bode", "simulate", "posterior", "calibrate", "diagnose", "false-alarms", "blind",
    "linearise", "design", "closed-loop", "export", "campaign",
)  # fmt: skip
HEAVY = ("jax", "matplotlib", "pandas", "scipy", "numpy")


def test_the_version_is_reported(program) -> None:
    done = program("--version")
    assert (done.returncode, done.stdout) == (0, f"savgs-ident {__version__}\n")


def test_help_names_every_command_and_the_exit_codes(inside) -> None:
    done = inside("--help")
    assert done.returncode == 0
    for word in (*COMMANDS, "Exit codes"):
        assert word in done.stdout


@over("command", COMMANDS)
def test_the_help_of_a_command_has_an_example_and_its_files(invoke, command: str) -> None:
    done = invoke(command, "--help")
    assert done.exit_code == 0
    assert f"Example: savgs-ident {command}" in done.output
    assert "Writes" in done.output
    for option in ("--out", "--json", "--quiet"):
        assert option in done.output


def test_help_loads_nothing_heavy(environment: dict[str, str]) -> None:
    code = f"import sys, savgs_ident.cli.app; print([m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


def test_inspect_does_not_load_jax(environment: dict[str, str], short_campaign: Path, tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from savgs_ident.cli.app import run\n"
        "try:\n    run()\n"
        "except SystemExit as end:\n    assert end.code == 0, end.code\n"
        "assert 'matplotlib' in sys.modules\n"
        "print([m for m in ('jax', 'equinox', 'diffrax') if m in sys.modules])\n"
    )
    command = [sys.executable, "-c", code, "inspect", str(short_campaign), "--out", str(tmp_path), "--quiet"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "[]\n", "")


def test_json_alone_is_on_standard_output_and_equals_the_file(inside, short_campaign, tmp_path: Path) -> None:
    done = inside("inspect", short_campaign, "--json", "--out", tmp_path / "o")
    assert done.returncode == 0
    assert done.stdout == (tmp_path / "o" / "inspect.json").read_text()
    assert len(json.loads(done.stdout)["dwells"]) == 4
    assert "reading" in done.stderr


def test_quiet_says_nothing(inside, short_campaign: Path) -> None:
    done = inside("inspect", short_campaign, "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_files_go_to_a_folder_of_the_command_by_default(inside, short_campaign: Path, tmp_path: Path) -> None:
    assert inside("inspect", short_campaign).returncode == 0
    found = sorted(path.name for path in (tmp_path / "out" / "inspect").iterdir())
    assert found == ["inspect.json", "inspect.pdf", "inspect.png"]


def test_a_missing_file_is_one_line_and_code_2(inside) -> None:
    done = inside("inspect", "nowhere.csv")
    assert done.returncode == 2
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if not line.startswith("reading")]
    assert lines == ["Error: nowhere.csv: does not exist. Remedy: check the path."]


@pytest.mark.slow
def test_ctrl_c_is_one_line_and_code_130(
    environment: dict[str, str], nominal_campaign: Path, tmp_path: Path
) -> None:
    running = subprocess.Popen(
        [*COMMAND, "fit", str(nominal_campaign), "--out", str(tmp_path)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert running.stderr is not None
    assert "reading" in running.stderr.readline()
    time.sleep(0.1)
    running.send_signal(signal.SIGINT)
    output, messages = running.communicate(timeout=60)
    assert running.returncode == 130
    assert output == ""
    assert messages.splitlines()[-1] == "Stopped by Ctrl-C; files that were finished are kept."
    assert "Traceback" not in messages


@pytest.mark.slow
def test_a_reader_that_leaves_early_is_no_error(
    environment: dict[str, str], short_campaign: Path, tmp_path: Path
) -> None:
    words = [*COMMAND, "inspect", str(short_campaign), "--out", str(tmp_path), "--json"]
    line = f"{shlex.join(words)} | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", line], env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr
