"""Many campaigns side by side: what becomes of them when processes are killed, here and on a cluster."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from savgs_ident.cli.console import NOT_TRUSTED, OK

from .campaign_fakes import campaign_file

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).resolve().parents[2]


def _rows(out: Path) -> list[dict[str, str]]:
    with (out / "campaigns.csv").open() as stream:
        return list(csv.DictReader(stream))


def _environment() -> dict[str, str]:
    return {key: value for key, value in os.environ.items() if not key.startswith("JAX_NUMPY_")}


def _started(out: Path, seconds: float, where: object, data: Path) -> "subprocess.Popen[str]":
    command = [
        sys.executable,
        "-m",
        "tests.cli.campaign_fakes",
        str(out),
        str(seconds),
        str(where),
        str(data),
    ]
    return subprocess.Popen(
        command, cwd=REPOSITORY, env=_environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def _at_work(data: Path, count: int) -> list[int]:
    """The processes that have begun a campaign, as soon as there are ``count``."""
    for _ in range(600):
        found = {int(path.suffix[1:]) for path in data.iterdir() if path.suffix[1:].isdecimal()}
        if len(found) >= count:
            return sorted(found)
        time.sleep(0.1)
    raise AssertionError("nothing was begun")


def _gone(process: int) -> bool:
    status = Path(f"/proc/{process}/stat")
    try:
        return status.read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def _all_gone(processes: list[int]) -> bool:
    for _ in range(200):
        if all(map(_gone, processes)):
            return True
        time.sleep(0.1)
    return False


@pytest.fixture
def six(tmp_path: Path) -> Path:
    """Six campaigns."""
    for number in range(6):
        campaign_file(tmp_path / "six" / f"run{number}.csv", float(number))
    return tmp_path / "six"


def test_what_a_killed_process_had_in_hand_is_done_again(six: Path, tmp_path: Path) -> None:
    with _started(tmp_path / "out", 2.0, 2, six) as process:
        os.kill(_at_work(six, 2)[0], signal.SIGKILL)
        _, said = process.communicate(timeout=120)
    assert process.returncode == OK, said
    assert [row["mu_r [1]"] for row in _rows(tmp_path / "out")] == [f"{n}.0" for n in range(6)]
    assert len(_at_work(six, 3)) == 3
    assert "6 of 6 done" in said


def test_a_campaign_whose_process_always_dies_is_a_failed_one(six: Path, tmp_path: Path) -> None:
    killed: set[int] = set()
    with _started(tmp_path / "out", 1.0, 2, six) as process:
        while process.poll() is None:
            for path in six.glob("run3.csv.*"):
                number = int(path.suffix[1:])
                if number not in killed:
                    killed.add(number)
                    os.kill(number, signal.SIGKILL)
            time.sleep(0.05)
        assert process.stderr is not None
        said = process.stderr.read()
    assert process.returncode == NOT_TRUSTED, said
    assert len(killed) == 3
    assert "Failed: run3: its process was killed by signal 9, 3 times" in said
    assert [row["status"] for row in _rows(tmp_path / "out")] == ["ok", "ok", "ok", "failed", "ok", "ok"]


def test_a_killed_run_leaves_no_process_and_keeps_what_is_done(six: Path, tmp_path: Path) -> None:
    """One that is stopped by Ctrl-C does so, too: :mod:`.test_interrupted`."""
    out = tmp_path / "out"
    with _started(out, 1.5, 2, six) as process:
        workers = _at_work(six, 2)
        while len(list(out.glob("*/done.json"))) < 2:
            time.sleep(0.05)
        began = time.monotonic()
        process.kill()
        process.wait(30)
        assert time.monotonic() - began < 10.0
        assert process.returncode != OK
        assert _all_gone(workers)
    kept = len(list(out.glob("*/done.json")))
    assert 2 <= kept < 6
    with _started(out, 0.0, 2, six) as process:
        _, said = process.communicate(timeout=120)
    assert process.returncode == OK, said
    assert f"{kept} campaigns identified in an earlier run" in said
    assert len(_rows(out)) == 6


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[str]:
    """The address of a Dask scheduler with two workers that are not started again."""
    address = tmp_path / "scheduler.json"
    words = [
        ["dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(address)],
        *[
            ["dask_worker", "--scheduler-file", str(address), "--nthreads", "1", "--no-nanny", "--no-dashboard",
             "--local-directory", str(tmp_path)]
        ] * 2,
    ]  # fmt: skip
    started = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{name}", *rest],
            cwd=REPOSITORY, env=_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for name, *rest in words
    ]  # fmt: skip
    try:
        for _ in range(600):
            if address.exists() and address.stat().st_size:
                break
            time.sleep(0.1)
        yield str(json.loads(address.read_text())["address"])
    finally:
        for process in started:
            process.kill()
        for process in started:
            process.wait()


def test_what_a_killed_worker_of_a_cluster_had_in_hand_is_done_again(
    cluster: str, six: Path, tmp_path: Path
) -> None:
    with _started(tmp_path / "out", 2.0, cluster, six) as process:
        os.kill(_at_work(six, 2)[0], signal.SIGKILL)
        _, said = process.communicate(timeout=120)
    assert process.returncode == OK, said
    assert [row["mu_r [1]"] for row in _rows(tmp_path / "out")] == [f"{n}.0" for n in range(6)]
    assert [row["status"] for row in _rows(tmp_path / "out")] == 6 * ["ok"]
