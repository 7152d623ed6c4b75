"""Wall-clock times of work that JAX may still be doing when a call returns."""

import statistics
import time
from collections.abc import Callable
from typing import TypeVar

import jax

Result = TypeVar("Result")


def timed(work: Callable[[], Result]) -> tuple[Result, float]:
    """The finished result of ``work`` and how long it took [s]."""
    began = time.perf_counter()
    result = jax.block_until_ready(work())
    return result, time.perf_counter() - began


def median_time(work: Callable[[], object], repeats: int) -> float:
    """Median time [s] of ``repeats`` runs of ``work``."""
    return statistics.median(timed(work)[1] for _ in range(repeats))
