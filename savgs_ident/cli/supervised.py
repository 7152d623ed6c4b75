"""Work in processes side by side, each watched: what one that was killed had in hand is done again by another.

    for number, result in supervised(work, tasks, 4):
        ...                                    # as they come; tasks[number] gave result

A process has one task at a time and a pipe of its own, so that its end, whatever the cause, concerns that task and no
other. The processes end with the program, however it ends.
"""

import multiprocessing
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Generic, TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3
"""How often a task is begun before it is given up."""

TASKS = 64
"""Tasks of a process before it makes room for a new one: what libraries keep would fill the memory in time."""

_PATIENCE_S = 5.0
"""How long a process may take to end by itself."""


@dataclass(frozen=True)
class Lost:
    """No result: the process ended each time; ``reason`` says how."""

    reason: str


class _Worker(Generic[Task, Result]):
    """A process, our end of its pipe, the number of the task it has in hand, and how many it was given."""

    def __init__(self, work: Callable[[Task], Result]) -> None:
        self.number: int | None = None
        self.given = 0
        # Forked processes would share the threads of JAX.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(target=_serve, args=(theirs,))
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


def supervised(
    work: Callable[[Task], Result], tasks: Sequence[Task], workers: int, each_does: int = TASKS
) -> Iterator[tuple[int, Result | Lost]]:
    """Numbers of tasks and what ``work``, defined at the top of a module, made of them; ``workers`` at a time.

    A process makes room for a new one when it was given as many tasks as ``each_does``. A task whose process ends is
    begun again, :data:`ATTEMPTS` times at most. Work that raises ends its process.
    """
    waiting, begun = deque(range(len(tasks))), [0] * len(tasks)
    crew: list[_Worker[Task, Result]] = []
    try:
        while waiting or any(each.number is not None for each in crew):
            while waiting and len(crew) < workers:
                # An interrupt in between would leave a process that nobody ends.
                with _interrupts_held_back():
                    crew.append(_Worker(work))
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
    from savgs_ident.cli.worker_process import end_with_parent

    end_with_parent()
    try:
        work = connection.recv()
        while True:
            connection.send(work(connection.recv()))  # type: ignore[operator]
    except (EOFError, BrokenPipeError):
        sys.exit()


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
