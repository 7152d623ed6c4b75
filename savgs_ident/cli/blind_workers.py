"""Work in processes side by side that end with the program, however it ends."""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

from savgs_ident.cli.worker_process import end_with_parent

Result = TypeVar("Result")

TASKS = 6
"""Tasks of a process before all make room for new ones: compiled programs would fill the memory in time."""


def side_by_side(work: Callable[[int], Result], numbers: Sequence[int], jobs: int) -> Iterator[Result]:
    """The results of ``work``, defined at the top of a module, as they come; ``jobs`` at a time.

    One at a time is done in this process. Where the work ends early, so do the processes.
    """
    if jobs == 1 or len(numbers) < 2:
        from savgs_ident.simulate.compilation import make_room_for_programs

        for number in numbers:
            make_room_for_programs()
            yield work(number)
        return
    for first in range(0, len(numbers), TASKS * jobs):
        yield from _batch(work, numbers[first : first + TASKS * jobs], jobs)


def _batch(work: Callable[[int], Result], numbers: Sequence[int], jobs: int) -> Iterator[Result]:
    """The same in processes of their own."""
    # Forked processes would share the threads of JAX.
    context = multiprocessing.get_context("spawn")
    before = set(multiprocessing.active_children())
    with ProcessPoolExecutor(min(jobs, len(numbers)), context, _prepare) as pool:
        waiting = [pool.submit(work, number) for number in numbers]
        finished = False
        try:
            for each in as_completed(waiting):
                yield each.result()
            finished = True
        finally:
            if not finished:
                for each in waiting:
                    each.cancel()
                for child in set(multiprocessing.active_children()) - before:
                    child.terminate()


def _prepare() -> None:
    """Make a new process keep its programs, and end with the one that started it."""
    from savgs_ident.simulate.compilation import use_persistent_cache

    use_persistent_cache()
    end_with_parent()
