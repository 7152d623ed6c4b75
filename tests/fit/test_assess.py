"""What is said of a fit whose model lacks something."""

import numpy as np

from savgs_ident.fit.identifiability import EXPLAINED, assess
from savgs_ident.plants.quarter_car.model import FREE

from .bench import TRUTH, Bench, silent


def test_a_model_that_explains_the_data_is_not_complained_of(bench: Bench) -> None:
    found = bench.fit(bench.predicted(TRUTH) + bench.noise(4))
    verdict = assess(bench.task, bench.minimiser, found, silent)
    assert not any("does not explain" in sentence for sentence in verdict.sentences)


def test_a_model_that_lacks_something_is_said_first(bench: Bench) -> None:
    """Deflection read 3 % too large: no friction or damping can make up for that."""
    data = bench.predicted(TRUTH) + bench.noise(4)
    data[:, 1] *= 1.03
    found = bench.fit(data)
    entries = bench.task.problem.target.entries
    excess = float(np.sum(found.residual**2)) / (entries - len(FREE))
    assert excess > EXPLAINED
    first = assess(bench.task, bench.minimiser, found, silent).sentences[0]
    assert first.startswith("The model does not explain these data")
    assert f"chi2/dof = {excess:.3g}" in first
