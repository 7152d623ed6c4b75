"""Inputs side by side in processes of their own: a reader that ends its process, or never ends, costs one input."""

import multiprocessing
import os
import shutil
import signal
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from fuzz.outcome import Kind, Outcome

AT_ONCE = 100
"""Inputs that are sent to a process together."""

PATIENCE = 600.0
"""So long an input may take by the clock [s] before its process is ended: its limit is in time of the processor, of
which a busy machine gives little; this is for what that cannot stop."""


@dataclass(frozen=True)
class Batch:
    """Inputs of one loader: their numbers."""

    loader: str
    numbers: tuple[int, ...]


OnBatch = Callable[[Batch], None]
"""Called with each batch when it begins."""


@dataclass
class _Worker:
    """A process, what it has still to do, and when it was last heard of (by the clock)."""

    process: BaseProcess
    connection: Connection
    loader: str
    left: deque[int]
    since: float


def batches_of(names: Sequence[str], count: int) -> list[Batch]:
    """``count`` inputs of every loader, in pieces."""
    return [
        Batch(name, tuple(range(begin, min(begin + AT_ONCE, count))))
        for name in names
        for begin in range(0, count, AT_ONCE)
    ]


def run_side_by_side(
    batches: Sequence[Batch], seed: int, jobs: int, folder: Path, on_batch: OnBatch = lambda batch: None
) -> Iterator[Outcome]:
    """The outcome of every input, as they come; a failing input is left in ``folder``.

    ``on_batch`` is called with each batch that begins.
    """
    pool = _Pool(seed, folder, on_batch, deque(batches), [])
    try:
        yield from pool.outcomes(jobs)
    finally:
        for worker in pool.workers:
            worker.process.kill()


@dataclass
class _Pool:
    """The processes at work, and the batches that none has begun."""

    seed: int
    folder: Path
    on_batch: OnBatch
    waiting: deque[Batch]
    workers: list[_Worker]

    def outcomes(self, jobs: int) -> Iterator[Outcome]:
        """All, from so many processes at a time."""
        while self.waiting or self.workers:
            while self.waiting and len(self.workers) < jobs:
                self._begin()
            ready = wait([worker.connection for worker in self.workers], timeout=1.0)
            for worker in tuple(self.workers):
                if worker.connection in ready:
                    yield self._received(worker)
                elif time.monotonic() - worker.since > PATIENCE:
                    worker.process.kill()
                    yield self._lost(worker, f"is not done in {PATIENCE:g} s")

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs, self.seed, self.folder), daemon=True)
        process.start()
        theirs.close()
        worker = _Worker(process, ours, "", deque(), 0.0)
        self.workers.append(worker)
        self._send_batch(worker)

    def _send_batch(self, worker: _Worker) -> None:
        """The next batch, or the end where there is none."""
        if not self.waiting:
            worker.connection.close()
            self.workers.remove(worker)
            return
        batch = self.waiting.popleft()
        self.on_batch(batch)
        worker.loader, worker.left, worker.since = batch.loader, deque(batch.numbers), time.monotonic()
        worker.connection.send(batch)

    def _received(self, worker: _Worker) -> Outcome:
        """What a process says: an outcome, or nothing any more."""
        try:
            outcome: Outcome = worker.connection.recv()
        except (EOFError, ConnectionError):
            worker.process.join()
            return self._lost(worker, f"ends its process (exit code {worker.process.exitcode})")
        worker.left.popleft()
        worker.since = time.monotonic()
        if not worker.left:
            self._send_batch(worker)
        return outcome

    def _lost(self, worker: _Worker, reason: str) -> Outcome:
        """The process is gone: its input is kept, another process goes on with the rest."""
        self.workers.remove(worker)
        outcome = Outcome(worker.loader, worker.left.popleft(), Kind.failed, reason=reason)
        if worker.left:
            self.waiting.appendleft(Batch(worker.loader, tuple(worker.left)))
        # Where making the input is at fault there is none to write.
        with suppress(Exception):
            write_failure(self.folder, outcome, self.seed)
        return outcome


def work(connection: Connection, seed: int, folder: Path) -> None:
    """The body of a process: batch after batch until nobody sends one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import jax

    jax.config.update("jax_enable_x64", True)
    from fuzz.limits import limit_memory

    limit_memory()
    while True:
        try:
            batch: Batch = connection.recv()
        except EOFError:
            return
        for number in batch.numbers:
            connection.send(_one(batch.loader, seed, number, folder))


def _one(name: str, seed: int, number: int, folder: Path) -> Outcome:
    from fuzz.registry import LOADERS
    from fuzz.trial import run_trial

    with tempfile.TemporaryDirectory(prefix="fuzz-") as place:
        outcome = run_trial(LOADERS[name], seed, number, Path(place))
    if outcome.kind is Kind.failed:
        write_failure(folder, outcome, seed)
    return outcome


def write_failure(failures: Path, outcome: Outcome, seed: int) -> None:
    """Leave the input of a failure, made again, and what was said of it, in a folder of its own."""
    from fuzz.registry import LOADERS
    from fuzz.trial import input_of, place

    folder = failures / f"{outcome.loader}-{seed}-{outcome.number}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    loader = LOADERS[outcome.loader]
    place(loader, input_of(loader, seed, outcome.number).content, folder)
    report = f"{outcome.loader} {outcome.number}: {outcome.reason}\nby {outcome.how}\n\n{outcome.trace}"
    (folder / "failure.txt").write_text(report, encoding="utf-8", errors="backslashreplace")
