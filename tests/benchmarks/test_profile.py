"""Where the time of a process went is told by who worked while it passed."""

import json
import subprocess
import sys

import pytest

from benchmarks.profile import MEANINGS
from benchmarks.sampled import PHASES

WORK = """
import json, threading, time
import numpy as np
from benchmarks.sampled import Sampler

def decompose():
    matrix, end = np.eye(60) + np.arange(60.0), time.perf_counter() + 0.4
    while time.perf_counter() < end:
        np.linalg.svd(matrix)

sampler = Sampler()
sampler.start()
{work}
sampler.stop()
print(json.dumps(sampler.spent))
"""


@pytest.mark.parametrize(
    "work",
    ["decompose()", "worker = threading.Thread(target=decompose); worker.start(); worker.join()"],
    ids=["in the first thread", "in another, while the first waits"],
)
def test_linear_algebra_is_known(work: str) -> None:
    ran = subprocess.run([sys.executable, "-c", WORK.format(work=work)], capture_output=True, check=True)
    spent = json.loads(ran.stdout)
    assert spent["linear algebra"] > 0.5 * sum(spent.values())


def test_every_phase_has_a_meaning() -> None:
    assert set(MEANINGS) == set(PHASES)
