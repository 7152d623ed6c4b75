"""What is made in threads: in order, one ahead, and with what it raises."""

import threading
import time
from collections.abc import Iterator

import pytest

from savgs_ident.core.threads import beside, computed_once, in_parallel, one_ahead, side_by_side


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


class _Asked:
    def __init__(self, work: threading.Barrier | None = None) -> None:
        self.work, self.times = work, 0

    @computed_once
    def number(self) -> int:
        """How often it was computed."""
        self.times += 1
        if self.work is None:
            time.sleep(0.05)
        else:
            self.work.wait(timeout=10.0)
        return self.times


def test_what_is_computed_once_is_waited_for_by_those_who_ask_the_same_object() -> None:
    asked = _Asked()
    assert in_parallel(lambda each: each.number, [asked] * 8) == [1] * 8
    assert asked.number == 1


def test_other_objects_are_not_waited_for() -> None:
    """Each of two waits until both are at work: one after the other they would never end."""
    both = threading.Barrier(2)
    one, other = _Asked(both), _Asked(both)
    assert side_by_side(lambda: one.number, lambda: other.number) == (1, 1)


def test_what_computing_raises_is_raised_and_those_who_waited_compute_one_at_a_time() -> None:
    class Hard:
        at_work, most, times = 0, 0, 0

        @computed_once
        def number(self) -> int:
            """Fails the first time."""
            self.at_work += 1
            self.most = max(self.most, self.at_work)
            self.times += 1
            fails = self.times == 1
            time.sleep(0.03)
            self.at_work -= 1
            if fails:
                raise ValueError("no number")
            return self.times

    def ask(hard: Hard) -> int | None:
        try:
            return hard.number
        except ValueError:
            return None

    hard = Hard()
    assert sorted(in_parallel(ask, [hard] * 6), key=str) == [2] * 5 + [None]
    assert hard.most == 1


def test_a_property_that_asks_itself_ends() -> None:
    class Circular:
        @computed_once
        def number(self) -> int:
            """Itself."""
            return self.number

    with pytest.raises(RecursionError):
        _ = Circular().number
