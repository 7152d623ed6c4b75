"""Trials in processes side by side that end with the program, however it ends."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TypeVar

from savgs_ident.cli.supervised import Lost, supervised
from savgs_ident.core.errors import InputError

Result = TypeVar("Result")

TASKS = 6
"""Trials of a process before it makes room for a new one: compiled programs would fill the memory in time."""


def side_by_side(work: Callable[[int], Result], numbers: Sequence[int], jobs: int) -> Iterator[Result]:
    """The results of ``work``, defined at the top of a module, as they come; ``jobs`` at a time.

    One at a time is done in this process. An error of the work is raised here and ends the others. Raises
    :class:`InputError` in the end, when the others are done, for what was given up because its process was killed.
    """
    if jobs == 1 or len(numbers) < 2:
        from savgs_ident.simulate.compilation import make_room_for_programs

        for number in numbers:
            make_room_for_programs()
            yield work(number)
        return
    lost: list[tuple[int, Lost]] = []
    for place, result in supervised(partial(_attempt, work), numbers, min(jobs, len(numbers)), TASKS):
        if isinstance(result, Lost):
            lost.append((numbers[place], result))
        elif isinstance(result, Exception):
            raise result
        else:
            yield result
    for number, result in lost:
        raise InputError(
            result.reason,
            source=f"trial {number}",
            remedy="run again with fewer --jobs, which take less memory: it goes on where it was",
        )


def _attempt(work: Callable[[int], Result], number: int) -> Result | Exception:
    """The result of the work, or the error with which it ended."""
    from savgs_ident.simulate.compilation import use_persistent_cache

    use_persistent_cache()
    try:
        return work(number)
    except Exception as error:
        return error
