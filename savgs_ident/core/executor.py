"""The executor of all that fans out: campaigns, blind trials, false alarms, trials of a calibration.

    for number, result in run_tasks(work, tasks, workers=4):
        ...                                    # as they come; tasks[number] gave result

The work is a function at the top of a module, or a ``partial`` of one. It runs in processes of this machine, or on an
existing Dask cluster whose address is given. A process has one task at a time, so that its end, whatever the cause,
concerns that task and no other: what a worker that was killed had in hand is done again by another one, and what is
killed each time is :class:`Lost`. Ctrl-C ends the processes and leaves what came before with the caller, who keeps
each result as it comes (:mod:`savgs_ident.campaigns.store`, :mod:`savgs_ident.validation.trials`); the processes end
with the program, however it ends. What is too short for processes runs in threads (:mod:`savgs_ident.core.threads`).

The processes are our own because in loky's executor, as in that of the standard library, a process that is killed
breaks the pool, every task in hand is lost with it, and nothing says which one was to blame. Dask's local cluster
does keep the others, but is an optional dependency, opens ports, takes seconds to start, and answers Ctrl-C with
the tracebacks of its workers. Neither replaces processes after so many tasks, which bounds the memory that compiled
programs take. The executor stands in ``core`` because validation and campaigns use it, which are apart in the order
of imports.
"""

import asyncio
import logging
import multiprocessing
import os
import queue
import signal
import sys
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from savgs_ident.core.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3
"""How often a task is begun before it is given up."""

TASKS = 64
"""Tasks of a process before it makes room for a new one: what libraries keep would fill the memory in time."""

_PATIENCE_S = 5.0
"""How long a process may take to end by itself."""

_ENVIRONMENT = {"EQX_ON_ERROR": "nan"}
"""Of the processes, unless the user says otherwise. Checks that call back into Python from a compiled program would
keep it from being stored for the next run; a failed one gives NaN then, which is looked for."""

_CORES = "NPROC"
"""The variable that reserves cores for a process. XLA takes the size of its pool of threads from it."""

_THREADS = (_CORES, "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""The variables from which libraries take how many threads to use. Each process of several is told its share of the
cores: were each to use all of them, the threads would only get in each other's way."""


@dataclass(frozen=True)
class Lost:
    """No result: the process ended each time; ``reason`` says how."""

    reason: str


@dataclass(frozen=True)
class _Raised:
    """What the work raised."""

    error: Exception


def run_tasks(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: int,
    scheduler: str | None = None,
    each_does: int = 0,
) -> Generator[tuple[int, Result | Lost]]:
    """Numbers of tasks and what ``work`` made of them, as they come.

    They are done by ``workers`` processes at a time, each of which does ``each_does`` tasks (:data:`TASKS` if zero)
    before it makes room for a new one, or by the Dask cluster of a ``scheduler``. No workers is this process.

    What the work raises is raised here and ends the others. Whoever may be interrupted between two results closes the
    iterator (:func:`contextlib.closing`): the processes wait for more until then.

    Raises :class:`InputError` for a cluster that does not
    answer or has no worker.
    """
    attempt: Callable[[Task], Result | _Raised] = partial(_attempt, work)
    found: Iterator[tuple[int, Result | _Raised | Lost]]
    if scheduler is not None:
        found = on_cluster(scheduler, attempt, tasks)
    elif workers == 0:
        found = ((number, work(task)) for number, task in enumerate(tasks))
    else:
        found = on_processes(attempt, tasks, min(workers, len(tasks)), each_does or TASKS)
    for number, result in found:
        if isinstance(result, _Raised):
            raise result.error
        yield number, result


def cores() -> int:
    """The cores that this process may use: those that it is bound to, or fewer where ``NPROC`` says so."""
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    reserved = os.environ.get(_CORES, "")
    return min(bound, max(1, int(reserved))) if reserved.isdecimal() else bound


def compute_on_one_core() -> None:
    """Have this process use one core: for processes of which there are as many as cores.

    To be called before anything is computed.
    """
    os.environ[_CORES] = "1"


def _attempt(work: Callable[[Task], Result], task: Task) -> Result | _Raised:
    try:
        return work(task)
    except Exception as error:
        return _Raised(error)


class _Worker(Generic[Task, Result]):
    """A process, our end of its pipe, the number of the task it has in hand, and how many it was given."""

    def __init__(self, work: Callable[[Task], Result], share: int) -> None:
        self.number: int | None = None
        self.given = 0
        # Forked processes would share the threads of JAX.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(target=_serve, args=(theirs,), daemon=True)
        with _environment_of_workers(share):
            self.process.start()
        # With its own end closed here, the death of the process is the end of what can be read.
        theirs.close()
        self._send(work)

    def give(self, number: int, task: Task) -> None:
        """Hand over a task; one that is handed to a dead process is noticed as lost when it is read."""
        self.number = number
        self.given += 1
        self._send(task)

    def take(self) -> Result:
        """Its result; :class:`EOFError` or :class:`OSError` if the process ended instead."""
        result: Result = self.connection.recv()
        return result

    def how_it_ended(self) -> str:
        """What became of a process that ended in the middle."""
        self.process.join(_PATIENCE_S)
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"its process was killed by signal {-code}"
        return f"its process ended with code {code}"

    def stop(self) -> None:
        """End the process at once."""
        self.connection.close()
        self.process.terminate()
        self.process.join(_PATIENCE_S)
        self.process.kill()
        self.process.join()

    def _send(self, what: object) -> None:
        try:
            self.connection.send(what)
        except OSError:
            return


def on_processes(
    work: Callable[[Task], Result], tasks: Sequence[Task], workers: int, each_does: int = TASKS
) -> Iterator[tuple[int, Result | Lost]]:
    """Numbers of tasks and what ``work`` made of them in processes of this machine, ``workers`` at a time.

    A process makes room for a new one when it was given as many tasks as ``each_does``. A task whose process ends is
    begun again, :data:`ATTEMPTS` times at most. Each process is told its share of the cores.
    """
    waiting, begun = deque(range(len(tasks))), [0] * len(tasks)
    share = max(1, cores() // max(1, workers))
    crew: list[_Worker[Task, Result]] = []
    try:
        while waiting or any(each.number is not None for each in crew):
            while waiting and len(crew) < workers:
                # An interrupt in between would leave a process that nobody ends.
                with _interrupts_held_back():
                    crew.append(_Worker(work, share))
            for each in crew:
                if each.number is None and waiting:
                    each.give(waiting[0], tasks[waiting[0]])
                    begun[waiting.popleft()] += 1
            busy = {each.connection: each for each in crew if each.number is not None}
            for ready in wait(list(busy)):
                one = next(each for connection, each in busy.items() if connection is ready)
                number, one.number = one.number, None
                assert number is not None
                try:
                    result: Result | Lost = one.take()
                except (EOFError, OSError):
                    crew.remove(one)
                    result = Lost(f"{one.how_it_ended()}, {begun[number]} times")
                    one.stop()
                    if begun[number] < ATTEMPTS:
                        waiting.append(number)
                        continue
                yield number, result
                if one in crew and one.given >= each_does:
                    crew.remove(one)
                    one.stop()
    finally:
        for each in crew:
            each.stop()


def _serve(connection: "Connection[object, object]") -> None:
    """The life of a process: the work to do, then task after task until there are no more."""
    # At Ctrl-C it is ended by the process that started it, and by itself if that one is killed.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_after_parent, daemon=True).start()
    try:
        work = connection.recv()
        while True:
            connection.send(work(connection.recv()))  # type: ignore[operator]
    except (EOFError, BrokenPipeError):
        sys.exit()


def _end_after_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


@contextmanager
def _environment_of_workers(share: int) -> Iterator[None]:
    """New processes inherit it; libraries read it when they are loaded, before the first task."""
    before = dict(os.environ)
    os.environ.update({**_ENVIRONMENT, **dict.fromkeys(_THREADS, str(share)), **before})
    os.environ[_CORES] = str(share)
    try:
        yield
    finally:
        for name in {*_ENVIRONMENT, *_THREADS}:
            del os.environ[name]
        os.environ.update(before)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach, not even while they start; this one has it afterwards."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: held.append(number))
    try:
        with _blocked_for_new_processes():
            yield
    finally:
        signal.signal(signal.SIGINT, before)
        if held:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def _blocked_for_new_processes() -> Iterator[None]:
    """New processes inherit what is blocked, but no handler."""
    if sys.platform == "win32":
        yield
        return
    # Begun by the first process, it would end the blocking before that one has inherited it.
    resource_tracker.ensure_running()
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


ANSWER_S = 5.0
"""How long a scheduler may take to answer, and to have a worker [s]."""

LONELY_S = 60.0
"""How long a cluster may be without any worker in the middle of the work [s]."""

_LOOK_S = 0.5


def on_cluster(
    address: str, work: Callable[[Task], Result], tasks: Sequence[Task], lonely_s: float = LONELY_S
) -> Iterator[tuple[int, Result | Lost]]:
    """Numbers of tasks and what ``work``, defined at the top of a module, made of them, as they come.

    A task that the cluster gives up, or that is left when there was no worker for ``lonely_s`` [s] or no scheduler
    any more, is :class:`Lost`. Raises :class:`InputError` if Dask is not installed, or the scheduler does not answer
    or has no worker.
    """
    with _connected(address) as client:
        done: queue.SimpleQueue[tuple[int, Future[Any]]] = queue.SimpleQueue()
        run = uuid.uuid4().hex
        futures = {
            number: client.submit(work, task, key=f"savgs-ident-{run}-{number}", pure=False)
            for number, task in enumerate(tasks)
        }
        for number, future in futures.items():
            future.add_done_callback(lambda future, number=number: done.put((number, future)))
        seen = time.monotonic()
        while futures:
            try:
                number, future = done.get(timeout=_LOOK_S)
            except queue.Empty:
                seen = time.monotonic() if _has_workers(client) else seen
                if time.monotonic() - seen > lonely_s:
                    break
                continue
            seen = time.monotonic()
            del futures[number]
            yield number, _result_of(future, address)
        for number in futures:
            yield number, Lost(f"the cluster at {address} had no worker left")


def _result_of(future: "Future[Any]", address: str) -> Any:
    if future.status == "cancelled":
        return Lost(f"the connection to the cluster at {address} was lost")
    try:
        return future.result(timeout=LONELY_S)
    except Exception as error:
        return Lost(f"{type(error).__name__}: {' '.join(str(error).split())}")


def _has_workers(client: "Client") -> bool:
    return client.status == "running" and bool(client.scheduler_info().get("workers"))


@contextmanager
def _connected(address: str) -> Iterator["Client"]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            "Dask is not installed", source="--scheduler", remedy="pip install 'savgs-ident[cluster]'"
        ) from error
    # What matters is reported in our own words.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    until = time.monotonic() + ANSWER_S
    while not _asked(address).get("workers"):
        if time.monotonic() > until:
            raise _no_answer(address, "has no worker")
        time.sleep(_LOOK_S)
    with Client(address, timeout=ANSWER_S, set_as_default=False) as client:
        yield client


def _asked(address: str) -> dict[str, Any]:
    """What a scheduler says of itself. A client would wait for ever for what takes a connection and says nothing."""
    from distributed import Security, rpc

    async def ask() -> dict[str, Any]:
        async with rpc(address, connection_args=Security().get_connection_args("client")) as scheduler:
            said: dict[str, Any] = await scheduler.identity()
            return said

    try:
        return dict(asyncio.run(asyncio.wait_for(ask(), ANSWER_S)))
    except Exception as error:
        # An address may be wrong in many ways, and what answers there may be no scheduler at all.
        raise _no_answer(address, "does not answer") from error


def _no_answer(address: str, what: str) -> InputError:
    return InputError(
        f"the Dask scheduler at {address} {what}",
        source="--scheduler",
        remedy="start `dask scheduler` and `dask worker ADDRESS`, and give the address that it prints",
    )
