"""The installed program stopped in the middle: its code, its last words, what is left of it."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig

from .installed import Installed, files_in

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc"),
]

STOPPED = "Stopped by Ctrl-C; files that were finished are kept."
QUICK = ("--free", "c_sd", "--max-frequency", "2", "--fixed-tolerances")


def _until(true: Callable[[], bool], process: "subprocess.Popen[str]") -> None:
    for _ in range(3000):
        if true():
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.1)
    process.kill()
    raise AssertionError("it never came that far")


def _children(process: "subprocess.Popen[str]") -> list[int]:
    reported = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
    return [int(number) for number in reported.split()]


def _gone(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def _interrupt_twice(process: "subprocess.Popen[str]") -> tuple[str, list[str]]:
    """What it says on standard output, and the lines on standard error."""
    process.send_signal(signal.SIGINT)
    time.sleep(0.2)
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    output, messages = process.communicate(timeout=60)
    assert process.returncode == 130, messages
    assert "Traceback" not in messages
    assert "Exception" not in messages
    return output, messages.splitlines()


def test_a_fit_that_is_interrupted_in_its_search(installed: Installed, nominal_campaign: Path) -> None:
    process = installed.start("fit", nominal_campaign, "--out", "o")
    assert process.stderr is not None
    while not process.stderr.readline().startswith("preparing the fit"):
        assert process.poll() is None
    output, lines = _interrupt_twice(process)
    assert output == ""
    assert lines[-1] == STOPPED
    assert files_in(installed.folder / "o") == []


def test_a_posterior_that_is_interrupted_keeps_its_chain(installed: Installed, short_campaign: Path) -> None:
    chain = installed.folder / "o" / "chain-emcee.h5"
    words = ("posterior", default_rig_path(), short_campaign, *QUICK[2:], "--out", "o", "--quiet")
    process = installed.start(*words)
    _until(chain.exists, process)
    output, lines = _interrupt_twice(process)
    assert output == ""
    assert lines == [
        "The chain so far is in o/chain-emcee.h5: the same command with --resume goes on from there.",
        STOPPED,
    ]
    assert files_in(installed.folder / "o") == ["chain-emcee.h5"]
    before = _steps(chain)
    again = installed.run(*words, "--resume", "--time-limit", "1")
    assert again.returncode in (0, 1), again.stderr
    after = _steps(chain)
    assert 0 < len(before) < len(after)
    np.testing.assert_array_equal(after[: len(before)], before)


def _steps(chain: Path) -> np.ndarray:
    """The draws of all walkers (steps, walkers, parameters)."""
    with h5py.File(chain, "r") as file:
        return np.asarray(file["mcmc"]["chain"][: file["mcmc"].attrs["iteration"]])


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_campaign_keeps_what_is_finished_and_leaves_no_process(
    installed: Installed, short_campaign: Path, how: signal.Signals
) -> None:
    data, out = installed.folder / "data", installed.folder / "o"
    data.mkdir()
    for number in range(6):
        shutil.copy(short_campaign, data / f"run{number}.csv")
    process = installed.start("campaign", data, *QUICK, "--workers", "2", "--out", "o", "--quiet")
    _until(lambda: bool(list(out.glob("*/done.json"))), process)
    workers = _children(process)
    assert workers
    if how is signal.SIGINT:
        output, lines = _interrupt_twice(process)
        assert lines == [STOPPED]
        assert not list(out.glob(".*"))
    else:
        process.send_signal(how)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == -signal.SIGTERM
    assert output == ""
    for _ in range(100):
        if all(map(_gone, workers)):
            break
        time.sleep(0.1)
    assert all(map(_gone, workers))
    finished = [seal.parent for seal in out.glob("*/done.json")]
    assert 1 <= len(finished) < 6
    for folder in finished:
        assert json.loads((folder / "fit.json").read_text())["status"] == "converged"
        read_rig(folder / "model.toml")
    assert not (out / "campaign.json").exists()


def test_a_terminated_fit_leaves_nothing_half_done(installed: Installed, short_campaign: Path) -> None:
    process = installed.start("fit", short_campaign, *QUICK, "--out", "o", "--quiet")
    _until((installed.folder / "o" / "model.toml").exists, process)
    os.kill(process.pid, signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGTERM
    read_rig(installed.folder / "o" / "model.toml")
    assert json.loads((installed.folder / "o" / "fit.json").read_text())
    assert set(files_in(installed.folder / "o")) <= {"fit.json", "model.toml", "bode.png"}
