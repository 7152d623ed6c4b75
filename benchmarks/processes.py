"""Whole processes: how long they run and how much memory they take at most (POSIX)."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from benchmarks.outcome import Outcome, Progress
from benchmarks.write_long_mcap import write_long_mcap
from benchmarks.write_long_recordings import RATE_HZ, WRITERS, signals
from savgs_ident.plants.quarter_car.rig import default_campaign_path


class Ran(NamedTuple):
    """Wall-clock time [s], most resident memory [MB], exit code, standard output."""

    seconds: float
    peak_mb: float
    code: int
    output: str


def run_process(arguments: Sequence[str], environment: Mapping[str, str] | None = None) -> Ran:
    """Run Python with ``arguments`` to its end; what it says on standard error is dropped."""
    starter = Path(__file__).with_name("measure_process.py")
    ran = subprocess.run(
        [sys.executable, starter, sys.executable, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env=os.environ | dict(environment or {}),
    )
    return Ran(*json.loads(ran.stdout))


def measure_fit(progress: Progress) -> Outcome:
    """``savgs-ident fit`` on the shipped campaign, without and with compiled programs in the cache."""
    return _cold_and_cached("fit", (), progress)


def measure_diagnosis(progress: Progress) -> Outcome:
    """``savgs-ident diagnose`` on the shipped campaign; both as above.

    From the baseline without any friction, which the catalogue knows, and from one without friction of the rail,
    which it is not told of, so that a law has to be learned.
    """
    known = _cold_and_cached("diagnose", ("--model", "simqc"), progress)
    options = ("--model", "simqc", "--with", "tyre_friction", "--without", *RAIL_FRICTIONS)
    return known + _cold_and_cached("diagnose", options, progress, "diagnose_other")


RAIL_FRICTIONS = ("rail_coulomb", "rail_stribeck", "rail_asymmetry")
"""Effects that are, or contain, the friction of the rail."""


def _cold_and_cached(command: str, options: Sequence[str], progress: Progress, name: str = "") -> Outcome:
    name = name or command
    with TemporaryDirectory() as folder:
        arguments = ["-m", "savgs_ident.cli", command, str(default_campaign_path()), *options]
        arguments += ["--out", str(Path(folder) / "out"), "--quiet"]
        environment = {"SAVGS_IDENT_CACHE": str(Path(folder) / "cache")}
        progress(f"{name}: first time")
        cold = run_process(arguments, environment)
        progress(f"{name}: with the cache")
        cached = run_process(arguments, environment)
    ended = {cold.code, cached.code} - {0}
    return Outcome(
        {
            f"{name}_cold_s": cold.seconds,
            f"{name}_cached_s": cached.seconds,
            f"{name}_peak_mb": max(cold.peak_mb, cached.peak_mb),
        },
        (f"{name}: ended with exit code {max(ended)}, so its figures mean nothing",) if ended else (),
    )


def measure_mcap(minutes: float, progress: Progress) -> Outcome:
    """Reading a long MCAP campaign of JSON messages with six channels each."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "long.mcap"
        progress(f"mcap: writing {minutes:g} minutes")
        samples = write_long_mcap(path, minutes, RATE_HZ)
        size_mb = path.stat().st_size / 1e6
        progress("mcap: reading")
        ran = run_process(["-m", "benchmarks.read_whole", str(path)])
    if ran.code != 0:
        return Outcome({}, (f"mcap: reading ended with exit code {ran.code}",))
    return Outcome(
        {"mcap_samples_per_s": samples / float(ran.output), "mcap_peak_mb": ran.peak_mb},
        (
            f"mcap: {minutes:g} minutes at {RATE_HZ:g} Hz, {samples} samples of six channels, "
            f"{size_mb:.0f} MB (zstd).",
        ),
    )


def measure_readers(minutes: float, progress: Progress) -> Outcome:
    """Reading a long recording of eight channels in every format but MCAP, each in a process of its own."""
    outcome = Outcome()
    for name, write in WRITERS.items():
        with TemporaryDirectory() as folder:
            progress(f"readers: writing {minutes:g} minutes as {name}")
            path = write(Path(folder), signals(minutes))
            size_mb = path.stat().st_size / 1e6
            progress(f"readers: reading {name}")
            ran = run_process(["-m", "benchmarks.read_whole", str(path)])
        if ran.code != 0:
            outcome += Outcome({}, (f"readers: {name} ended with exit code {ran.code}",))
            continue
        seconds = float(ran.output)
        figures = {f"read_{name}_x": 60.0 * minutes / seconds, f"read_{name}_mb": ran.peak_mb}
        outcome += Outcome(figures, (f"readers: {minutes:g} minutes as {name}, {size_mb:.0f} MB.",))
    return outcome
