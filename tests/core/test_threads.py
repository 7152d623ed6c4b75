"""What is made in threads: in order, one ahead, and with what it raises."""

import threading
from collections.abc import Iterator

import pytest

from savgs_ident.core.threads import beside, one_ahead


def test_items_come_in_order_from_another_thread_one_ahead() -> None:
    made: list[tuple[int, int]] = []

    def items() -> Iterator[int]:
        for number in range(4):
            made.append((number, threading.get_ident()))
            yield number

    seen = []
    for item in one_ahead(items()):
        seen.append(item)
        assert len(made) <= item + 2
    assert seen == [0, 1, 2, 3]
    assert {thread for _, thread in made}.isdisjoint({threading.get_ident()})


def test_what_making_an_item_raises_comes_after_those_before() -> None:
    def items() -> Iterator[int]:
        yield 1
        raise ValueError("damaged")

    ahead = one_ahead(items())
    assert next(ahead) == 1
    with pytest.raises(ValueError, match="damaged"):
        next(ahead)


def test_nothing_is_made_any_more_once_it_is_closed() -> None:
    made: list[int] = []

    def items() -> Iterator[int]:
        for number in range(100):
            made.append(number)
            yield number

    ahead = one_ahead(items())
    next(ahead)
    ahead.close()
    assert len(made) <= 2


def test_work_beside_is_done_at_the_end_and_what_it_raises_is_not_raised() -> None:
    done: list[int] = []
    with beside(lambda: done.append(1)):
        pass
    assert done == [1]
    with beside(lambda: 1 / 0):
        done.append(2)
    assert done == [1, 2]
