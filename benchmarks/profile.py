"""Where the wall time of each command goes: from an empty cache of programs, and again.

    python -m benchmarks --profile docs/profile.md

Every command is a process of its own, on the shipped campaign, bytecode cached, and is looked at as it runs
(:mod:`benchmarks.sampled`).
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from benchmarks.machine import describe_machine
from benchmarks.outcome import Progress
from benchmarks.sampled import PHASES
from savgs_ident.plants.quarter_car.rig import default_campaign_path

COMMANDS: Mapping[str, Sequence[str]] = {
    "inspect": (),
    "fit": (),
    "bode": (),
    "diagnose": ("--model", "simqc"),
    "posterior": (),
}
"""Commands on a campaign, with their options."""

OF_A_MODEL = ("bode", "posterior")
"""Those that take what was fitted before."""

MEANINGS = {
    "imports": "modules being loaded",
    "reading": "recordings",
    "responses": "harmonics and their noise from recordings",
    "tracing": "Python leading through a model, to make a program of it",
    "compiling": "XLA making machine code of a program",
    "loading programs": "programs from the cache, and finding which",
    "solving": "compiled programs running",
    "searching": "the package's own Python: steps, decisions, tables",
    "linear algebra": "NumPy's and SciPy's",
    "pictures": "pictures and pages",
    "writing": "files",
    "other": "Python starting and ending, processes that are waited for, the rest",
}
"""What each phase is."""


class Profiled(NamedTuple):
    """A command that ran: its wall time [s], what each phase took of it [s], and its exit code."""

    seconds: float
    spent: Mapping[str, float]
    code: int


def _run(arguments: Sequence[str], cache: Path, record: Path) -> Profiled:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    record.unlink(missing_ok=True)
    began = time.perf_counter()
    code = subprocess.run(
        [sys.executable, "-m", "benchmarks.sampled", record, *arguments],
        env=environment | {"SAVGS_IDENT_CACHE": str(cache)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=False,
    ).returncode
    seconds = time.perf_counter() - began
    spent = json.loads(record.read_text())
    unseen = seconds - sum(spent.values())
    return Profiled(seconds, spent | {"other": spent.get("other", 0.0) + unseen}, code)


def profile(progress: Progress) -> str:
    """A page that tells where the time of each command goes."""
    lines = []
    with TemporaryDirectory() as folder:
        here = Path(folder)
        for command, options in COMMANDS.items():
            for run in ("first", "again"):
                progress(f"{command}: {run}")
                model = [str(here / "fit" / "model.toml")] if command in OF_A_MODEL else []
                arguments = [command, *model, str(default_campaign_path()), *options]
                arguments += ["--out", str(here / command), "--quiet"]
                found = _run(arguments, here / "cache", here / "record.json")
                lines.append(_row(command, run, found))
    return _page(lines)


def _row(command: str, run: str, found: Profiled) -> str:
    shares = [f"{found.spent.get(phase, 0.0):.1f}" for phase in PHASES]
    note = "" if found.code in (0, 1) else f" (exit code {found.code})"
    return f"| `{command}`{note}, {run} | {found.seconds:.1f} | {' | '.join(shares)} |"


def _page(lines: Sequence[str]) -> str:
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    ).stdout.strip()
    machine = describe_machine()
    columns = ["command", "all", *PHASES]
    return "\n".join(
        (
            "# Where the time goes",
            "",
            "Seconds of wall time of each command on the shipped campaign, taken by",
            "`python -m benchmarks --profile docs/profile.md`. The first run of a command finds no programs in the",
            "cache but those of the commands before it.",
            "",
            f"Commit {commit or 'unknown'}, {machine['machine_cpu']}, {machine['machine_cores']:g} cores,",
            f"Python {machine['machine_python']}, {machine['machine_versions']}.",
            "",
            f"| {' | '.join(columns)} |",
            f"|{'---|' * len(columns)}",
            *lines,
            "",
            *(f"- *{phase}*: {MEANINGS[phase]}." for phase in PHASES),
            "",
        )
    )
