"""Processes that work for this one, interrupted while they start."""

import os
import signal
import subprocess
import sys
from multiprocessing.context import SpawnProcess

import pytest

from savgs_ident.core.executor import on_processes


def _started(monkeypatch: pytest.MonkeyPatch, whom: str) -> list[SpawnProcess]:
    """The processes that will have been started; each has ``whom`` interrupted at its start, itself or its parent."""
    started: list[SpawnProcess] = []
    start = SpawnProcess.start

    def interrupted(process: SpawnProcess) -> None:
        start(process)
        started.append(process)
        assert process.pid is not None
        os.kill(process.pid if whom == "itself" else os.getpid(), signal.SIGINT)

    monkeypatch.setattr(SpawnProcess, "start", interrupted)
    return started


def test_ctrl_c_while_a_process_starts_is_not_lost_and_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    started = _started(monkeypatch, "its parent")
    with pytest.raises(KeyboardInterrupt):
        list(on_processes(abs, [-1, -2], 1))
    assert [process.exitcode for process in started] == [-signal.SIGTERM]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_ctrl_c_does_not_reach_a_process_that_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    started = _started(monkeypatch, "itself")
    assert list(on_processes(abs, [-1, -2], 1)) == [(0, 1), (1, 2)]
    assert len(started) == 1


def test_where_ctrl_c_is_ignored_it_stays_so(monkeypatch: pytest.MonkeyPatch) -> None:
    _started(monkeypatch, "its parent")
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert list(on_processes(abs, [-1], 1)) == [(0, 1)]
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_program_that_ends_between_two_results_leaves_no_process() -> None:
    """It still holds the results when it ends, as a traceback does, and nobody closes them."""
    code = (
        "from multiprocessing import active_children\n"
        "from savgs_ident.core.executor import on_processes\n"
        "held = on_processes(abs, [-1, -2, -3], 1)\n"
        "print(next(held), *(each.pid for each in active_children()))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    *result, process = done.stdout.rsplit(maxsplit=1)
    assert result == ["(0, 1)"]
    with pytest.raises(ProcessLookupError):
        os.kill(int(process), 0)
