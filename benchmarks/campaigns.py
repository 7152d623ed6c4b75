"""Many campaigns by ``savgs-ident campaign``, on one process and on two.

The campaigns are the shipped one with further noise, another draw for each; programs are compiled before.
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from benchmarks.outcome import Outcome, Progress
from benchmarks.processes import Ran, run_process
from savgs_ident.plants.quarter_car.rig import default_campaign_path

COUNT = 32
"""Campaigns."""

NOISE = 0.3
"""Standard deviation of the further noise, relative to what is there at standstill."""

_STANDSTILL = "standstill"


def measure(progress: Progress, count: int = COUNT) -> Outcome:
    """Times of the whole command on one process and on two, and the ratio."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        progress(f"campaigns: writing {count}")
        write_campaigns(folder / "data", count)
        environment = {"SAVGS_IDENT_CACHE": str(folder / "cache")}
        progress("campaigns: compiling")
        first = _run(folder / "data" / "run00.csv.gz", 1, folder / "first", environment)
        ran = []
        for workers in (1, 2):
            progress(f"campaigns: {count} on {workers} at a time")
            ran.append(_run(folder / "data", workers, folder / f"out{workers}", environment))
        different = _results(folder / "out1") != _results(folder / "out2")
    codes = {each.code for each in (first, *ran)} - {0}
    return Outcome(
        {
            "campaigns_one_worker_s": ran[0].seconds,
            "campaigns_two_workers_s": ran[1].seconds,
            "campaigns_speedup_two_workers": ran[0].seconds / ran[1].seconds,
        },
        (
            f"campaigns: {count}, each the shipped campaign with noise of its own; whole processes.",
            *(
                (f"campaigns: ended with exit code {max(codes)}, so its figures mean nothing",)
                if codes
                else ()
            ),
            *(("campaigns: the results of the two runs are not the same",) if different else ()),
        ),
    )


def write_campaigns(folder: Path, count: int, tests: tuple[str, ...] | None = None) -> None:
    """Write ``count`` files run00.csv.gz, ... with all tests of the shipped campaign, or only some."""
    folder.mkdir()
    table = pd.read_csv(default_campaign_path())
    still = table[table["test"] == _STANDSTILL]
    if tests is not None:
        table = table[table["test"].isin(tests)]
    noisy = [name for name in table.columns if name.startswith(("sprung_accel", "susp_deflection"))]
    spread = NOISE * still[noisy].std().to_numpy()
    for number in range(count):
        random = np.random.default_rng(number)
        again = table.copy()
        again[noisy] += spread * random.standard_normal((len(table), len(noisy)))
        again.to_csv(folder / f"run{number:02d}.csv.gz", index=False, float_format="%.9g")


def _run(data: Path, workers: int, out: Path, environment: dict[str, str]) -> Ran:
    words = ["campaign", str(data), "--workers", str(workers), "--out", str(out), "--quiet"]
    return run_process(["-m", "savgs_ident.cli", *words], environment)


def _results(out: Path) -> object:
    return json.loads((out / "campaign.json").read_text())["campaigns"]
