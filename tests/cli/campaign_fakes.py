"""Campaigns that take no time: files of one number, identified by someone who reads it.

Run as a program, it identifies them in processes or on a cluster, slowly, for tests that kill:

    python -m tests.cli.campaign_fakes OUT SECONDS WORKERS|ADDRESS FOLDER ...
"""

import csv
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from savgs_ident.campaigns.run import (
    CampaignRun,
    CampaignTask,
    Failure,
    FitRequest,
    Outcome,
    identify_all,
    spread_of,
)
from savgs_ident.campaigns.store import StoredResult
from savgs_ident.cli.campaign import conclude
from savgs_ident.cli.console import Reporter
from savgs_ident.fit.least_squares import FitSettings
from savgs_ident.plants.quarter_car.rig import default_rig_path

STDERR = 0.1

OWN = 0.9
"""Share of the standard error of c_sd that each campaign has for itself."""

DAY = 86400.0
MONDAY = datetime(2026, 3, 2, 8, 0, tzinfo=UTC).timestamp()
SILENT, TALKING = Reporter(False, True), Reporter(False, False)


def campaign_file(path: Path, value: float, start: float | None = None, **more: Any) -> Path:
    """A campaign whose mu_r is found to be ``value``; ``more`` is what else there is to say."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"value": value, "start": start, **more}))
    return path


def request(*arguments: Path, **changes: Any) -> CampaignRun:
    """Identify mu_r and c_sd of the campaigns in ``arguments``; changes are of the single fit."""
    given: dict[str, Any] = {
        "campaign": Path(),
        "plant": "quarter_car",
        "rig": default_rig_path(),
        "channels": None,
        "model": "simtr",
        "beside": (),
        "free": ("mu_r", "c_sd"),
        "settings": FitSettings(),
        "max_frequency": None,
        "command": ("savgs-ident", "campaign"),
    }
    return CampaignRun(arguments, FitRequest(**(given | changes)), None, 2)


def read_number(task: CampaignTask) -> Outcome:
    """What is in the file, as the result of a fit."""
    path = task.request.campaign
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    reported = json.loads(files[0].read_text())
    if "failure" in reported:
        return Failure(reported["failure"], reported.get("unreadable", False))
    numbers = {
        "mu_r": (reported["value"], STDERR, "1"),
        "c_sd": (5792.0, 12.0, "N s/m"),
        "m_s": (320.0, 1.0, "kg"),
    }
    trusted = reported.get("trusted", True)
    record = {
        "schema": 1,
        "parameters": {
            name: {
                "value": value,
                "stderr": stderr,
                "own_stderr": OWN * stderr if name == "c_sd" else stderr,
                "unit": unit,
                "free": name != "m_s",
                "prior_sd": 1.25 if name == "m_s" else 0.0,
            }
            for name, (value, stderr, unit) in numbers.items()
        },
        "chi2_per_dof": 1.05,
        "trusted": trusted,
        "doubt": None if trusted else "the data do not identify every free parameter",
        "converged": True,
        "status": "converged",
        "advice": "converged",
    }
    return StoredResult(json.dumps(record), f"name = {json.dumps(task.source)}\n", reported["start"])


def never(*_: object) -> Any:
    """For a run that must not identify anything."""
    raise AssertionError("this is there already")


def one_by_one(
    work: Callable[[CampaignTask], Outcome], tasks: Sequence[CampaignTask]
) -> Iterator[tuple[int, Outcome]]:
    """The work in this process."""
    yield from ((number, work(task)) for number, task in enumerate(tasks))


def run(
    *arguments: Path, out: Path, work: Any = read_number, reporter: Reporter = SILENT, **changes: Any
) -> int:
    """The exit code of a run in this process."""
    return _concluded(request(*arguments, **changes), work, one_by_one, reporter, out)


def _concluded(asked: CampaignRun, work: Any, spread: Any, reporter: Reporter, out: Path) -> int:
    """The command, with other work and another executor."""
    with reporter.working() as progress:
        study = identify_all(asked, work, spread, out, progress)
        files = study.save(out, progress)
    return conclude(study, files, reporter)


def record_of(out: Path) -> dict[str, Any]:
    """What a run wrote about all campaigns."""
    found: dict[str, Any] = json.loads((out / "campaign.json").read_text())
    return found


def rows_of(out: Path) -> list[dict[str, str]]:
    """The table that a run wrote."""
    with (out / "campaigns.csv").open() as stream:
        return list(csv.DictReader(stream))


def slowly(seconds: float, task: CampaignTask) -> Outcome:
    """The same after some time; leaves a file of the process that does it, named after the campaign."""
    path = task.request.campaign
    (path.parent / f"{path.name}.{os.getpid()}").touch()
    time.sleep(seconds)
    return read_number(task)


def _main(out: str, seconds: str, where: str, *arguments: str) -> int:
    asked = request(*map(Path, arguments))
    local = where.isdecimal()
    asked = CampaignRun(asked.arguments, asked.one, None if local else where, int(where) if local else 1)
    slow = partial(slowly, float(seconds))
    return _concluded(asked, slow, spread_of(asked), Reporter(False, False), Path(out))


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
