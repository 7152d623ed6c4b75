"""Work in threads over all cores: compiled solvers, and readers in C, release Python's lock while they run."""

import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Generic, TypeVar, cast

from savgs_ident.core.executor import cores

Result = TypeVar("Result")
Item = TypeVar("Item")
Other = TypeVar("Other")


def in_parallel(work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Apply ``work`` to every item on all cores; results in the order of the items."""
    with ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(work, items))


def one_ahead(items: Iterable[Item]) -> Generator[Item]:
    """The items, each made in another thread while the one before it is worked on.

    What making one raises is raised where it is asked for.
    """
    iterator, end = iter(items), object()
    with ThreadPoolExecutor(1) as pool:
        begun = pool.submit(next, iterator, end)
        while (item := begun.result()) is not end:
            begun = pool.submit(next, iterator, end)
            yield cast(Item, item)


@contextmanager
def beside(work: Callable[[], object]) -> Iterator[None]:
    """Have ``work`` done in another thread meanwhile; the end waits for it, and what it raises is not raised."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(work)
        yield


def side_by_side(one: Callable[[], Result], other: Callable[[], Other]) -> tuple[Result, Other]:
    """Run two functions at the same time and return both results."""
    with ThreadPoolExecutor(1) as pool:
        begun = pool.submit(other)
        return one(), begun.result()


class computed_once(Generic[Result]):  # noqa: N801
    """A property that is computed once for each object: threads that ask the same object for it meanwhile wait.

    :func:`functools.cached_property` lets those wait that ask other objects, too, in Python 3.11, and computes it
    more than once in later ones.
    """

    def __init__(self, compute: Callable[[Any], Result]):
        self.__doc__ = compute.__doc__
        self._compute, self._name = compute, compute.__name__
        self._guard = threading.Lock()
        self._asking: dict[int, tuple[threading.RLock, int]] = {}

    def __get__(self, asked: Any, owner: type) -> Result:
        if asked is None:
            raise AttributeError(f"{owner.__name__}.{self._name} is known of objects only")
        known: dict[str, Result] = asked.__dict__
        with self._waiting_for(id(asked)):
            if self._name not in known:
                known[self._name] = self._compute(asked)
        return known[self._name]

    @contextmanager
    def _waiting_for(self, key: int) -> Iterator[None]:
        """With the lock of an object, which is there as long as anybody asks for it."""
        with self._guard:
            lock, asking = self._asking.get(key, (threading.RLock(), 0))
            self._asking[key] = lock, asking + 1
        try:
            with lock:
                yield
        finally:
            with self._guard:
                lock, asking = self._asking.pop(key)
                if asking > 1:
                    self._asking[key] = lock, asking - 1
