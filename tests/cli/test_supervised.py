"""Processes that work for this one: interrupted while they start, and each on its share of the cores."""

import os
import signal
import subprocess
import sys
from multiprocessing.context import SpawnProcess

import pytest

from savgs_ident.core.executor import cores, on_processes, run_tasks


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


@pytest.mark.parametrize(("workers", "share"), [(1, 4), (2, 2), (3, 1), (8, 1)])
def test_processes_side_by_side_share_the_cores(
    monkeypatch: pytest.MonkeyPatch, workers: int, share: int
) -> None:
    """What the user says of a library's threads stands; this process is left as it was."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(4)))
    monkeypatch.delenv("NPROC", raising=False)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    before = dict(os.environ)
    names = ["NPROC", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"]
    told = [found for _, found in on_processes(os.getenv, names, workers)]
    assert sorted(map(str, told)) == sorted([str(share), str(share), "7"])
    assert dict(os.environ) == before


def test_no_task_needs_no_process() -> None:
    assert list(run_tasks(abs, [], workers=2)) == []


@pytest.mark.parametrize(("reserved", "used"), [("", 4), ("2", 2), ("0", 1), ("9", 4), ("all", 4)])
def test_cores_are_those_bound_to_or_fewer_if_reserved(
    monkeypatch: pytest.MonkeyPatch, reserved: str, used: int
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(4)))
    monkeypatch.setenv("NPROC", reserved)
    assert cores() == used
