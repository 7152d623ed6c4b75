"""Where the time of a process went is told by who worked while it passed."""

import threading
import time

import numpy as np

from benchmarks.profile import MEANINGS
from benchmarks.sampled import PHASES, Sampler


def _decompose(seconds: float) -> None:
    matrix, end = np.random.default_rng(0).standard_normal((60, 60)), time.perf_counter() + seconds
    while time.perf_counter() < end:
        np.linalg.svd(matrix)


def _sampled(sampler: Sampler) -> dict[str, float]:
    sampler.stop()
    total = sum(sampler.spent.values())
    return {phase: spent / total for phase, spent in sampler.spent.items()}


def test_linear_algebra_is_known() -> None:
    sampler = Sampler()
    sampler.start()
    _decompose(0.4)
    assert _sampled(sampler)["linear algebra"] > 0.5


def test_while_the_first_thread_waits_others_count() -> None:
    worker = threading.Thread(target=_decompose, args=(0.4,))
    sampler = Sampler()
    sampler.start()
    worker.start()
    worker.join()
    assert _sampled(sampler)["linear algebra"] > 0.5


def test_every_phase_has_a_meaning() -> None:
    assert set(MEANINGS) == set(PHASES)
