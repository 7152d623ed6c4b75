"""Trials that take no time: rigs that nobody simulated, diagnosed by someone who looks at the trial's number.

Run as a program, it runs trials side by side, slowly, for tests that stop it:

    python -m tests.cli.blind_fakes FOLDER TRIALS JOBS SECONDS
"""

import os
import sys
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from savgs_ident.cli.console import Reporter
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.validation.blind import BlindRequest, run_blind
from savgs_ident.validation.blind_trial import Drawn, Plan
from savgs_ident.validation.virtual_rig import Bench

from ..diagnosis.blind_answers import answer, diagnosis

KINDS = {
    0: ("none",),
    1: ("effect", "accel_lag"),
    2: ("two", "accel_lag", "cam_scale"),
    3: ("unknown", "cam_scale"),
}
RIGHT = {"none": "none", "effect": "effect", "two": "several", "unknown": "unknown"}


def request(**changes: Any) -> BlindRequest:
    given: dict[str, Any] = {
        "trials": 6,
        "seed": 4,
        "jobs": 0,
        "rig": None,
        "shares": (20.0, 50.0, 15.0, 15.0),
        "every": 1,
        "sweep": False,
        "again": False,
        "command": ("savgs-ident", "blind"),
    }
    return BlindRequest(**(given | changes))


def draw(plan: Plan, bench: Bench, number: int) -> Drawn:
    """The kinds by turns; the number of the trial is hidden in the length of the standstill."""
    kind, *effects = KINDS[number % 4]
    drawn = answer(kind, *effects, number=number, accel_lag_time=0.01, cam_scale_change=0.02)
    random = np.random.default_rng((plan.seed, number))
    tests = [
        _test("dwell_5.00Hz", "dwell", 5.0, 500, random),
        _test("standstill", "standstill", None, 100 + number, random),
    ]
    return Drawn(drawn, random.bytes(16).hex(), tuple(tests))


def _test(
    name: str, kind: Any, frequency: float | None, count: int, random: np.random.Generator
) -> Recording:
    time_ = np.arange(count) / 500.0
    wave = np.cos(2.0 * np.pi * frequency * time_) if frequency else np.zeros(count)
    channels = {
        each: RecordedChannel(
            each, RIG_LAYOUT.si_unit(each), time_, size * wave + 1e-4 * random.standard_normal(count)
        )
        for each, size in {"road_height": 0.01, "sprung_accel": 2.0, "susp_deflection": 0.01}.items()
    }
    return Recording(name, kind, frequency, channels)


def number_of(folder: Path) -> int:
    (still,) = load_campaign(folder).of_kind("standstill")
    return still.channels["road_height"].time.size - 100


def always_right(folder: Path, rig: Rig, without: tuple[str, ...]) -> Mapping[str, Any]:
    """Right about every trial, from the recordings alone."""
    kind, *effects = KINDS[number_of(folder) % 4]
    assert without == (tuple(effects) if kind == "unknown" else ())
    intervals = {
        name: ends
        for effect, name, ends in (
            ("accel_lag", "accel_lag_time", (0.009, 0.011)),
            ("cam_scale", "cam_scale_change", (0.019, 0.021)),
        )
        if effect in effects
    }
    named = effects if kind in ("effect", "two") else []
    ports = {"ports": ["road"]} if kind == "unknown" else {}
    return diagnosis(RIGHT[kind], *named, intervals=intervals, **ports)


def always_none(folder: Path, rig: Rig, without: tuple[str, ...]) -> Mapping[str, Any]:
    """Never finds anything."""
    return diagnosis("none")


def slowly_right(seconds: float, folder: Path, rig: Rig, without: tuple[str, ...]) -> Mapping[str, Any]:
    """Right after some time; prints the number of its process."""
    # At once: lines of two processes would run into each other.
    os.write(1, f"{os.getpid()}\n".encode())
    time.sleep(seconds)
    return always_right(folder, rig, without)


def concluded(request: BlindRequest, draw: Any, diagnose: Any, reporter: Reporter, out: Path) -> int:
    """The exit code of the command, with other rigs and another diagnosis."""
    with reporter.working() as progress:
        study = run_blind(request, draw, diagnose, out, progress)
        files = study.save(out, progress)
    return reporter.conclude(study, files)


def _main(folder: str, trials: str, jobs: str, seconds: str) -> int:
    slow = partial(slowly_right, float(seconds))
    return concluded(
        request(trials=int(trials), jobs=int(jobs)), draw, slow, Reporter(False, True), Path(folder)
    )


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
