"""What is said of a fit whose model lacks something."""

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.fit.identifiability import (
    CHANCE,
    EXPLAINED,
    assess,
    explained_by_noise,
    misses_little,
    weighed_by_misfit,
)
from savgs_ident.fit.minimise import Minimum
from savgs_ident.plants.quarter_car.model import FREE

from .bench import TRUTH, Bench, silent


@pytest.mark.slow
def test_a_model_that_explains_the_data_is_not_complained_of(bench: Bench) -> None:
    found = bench.fit(bench.predicted(TRUTH) + bench.noise(4))
    assert explained_by_noise(bench.task.problem, found)
    verdict = assess(bench.task, bench.minimiser, found, True, silent)
    assert verdict.explained
    assert not any("does not explain" in sentence for sentence in verdict.sentences)


def test_a_model_that_lacks_something_is_said_first(bench: Bench) -> None:
    """Deflection read 3 % too large: no friction or damping can make up for that."""
    data = bench.predicted(TRUTH) + bench.noise(4)
    data[:, 1] *= 1.03
    found = bench.fit(data)
    entries = bench.task.problem.target.entries
    excess = float(np.sum(found.residual**2)) / (entries - len(FREE))
    assert excess > EXPLAINED
    assert not explained_by_noise(bench.task.problem, found)
    assert not misses_little(bench.task, found)
    verdict = assess(bench.task, bench.minimiser, found, False, silent)
    first = verdict.sentences[0]
    assert first.startswith("The model does not explain these data")
    assert f"chi2/dof = {excess:.3g}" in first
    assert "`diagnose`" in first
    assert not verdict.explained


def test_a_fit_that_broke_down_explains_nothing(bench: Bench) -> None:
    found = bench.fit(bench.predicted(TRUTH))
    lost = found._replace(evaluation=Status.NOT_FINITE, finite=False, residual=found.residual * np.nan)
    verdict = assess(bench.task, bench.minimiser, lost, True, silent)
    assert not verdict.explained
    assert not verdict.identifiable
    assert "`diagnose`" in verdict.sentences[0]


def test_a_model_that_errs_little_misses_little(bench: Bench) -> None:
    """Deflection read 0.4 % too large stands out of the noise, and is no more than any model errs by."""
    data = bench.predicted(TRUTH) + bench.noise(4)
    data[:, 1] *= 1.004
    found = bench.fit(data)
    assert not explained_by_noise(bench.task.problem, found)
    assert misses_little(bench.task, found)
    verdict = assess(bench.task, bench.minimiser, found, True, silent)
    assert "no more than small errors of any model" in verdict.sentences[0]


@pytest.mark.slow
def test_what_is_not_explained_is_in_the_errors(bench: Bench) -> None:
    """An error as large as all that is missed, along one parameter, is one standard error."""
    data = bench.predicted(TRUTH) + bench.noise(4)
    data[:, 1] *= 1.03
    found = bench.fit(data)
    priors = len(bench.task.problem.free.names)
    rows = found.residual[:-priors]
    expected = bench.task.problem.target.entries - len(FREE)
    missed = rows @ rows - expected - CHANCE * np.sqrt(2.0 * expected)
    mine = weighed(bench, found)
    np.testing.assert_allclose(mine[:-priors] * np.sqrt(1.0 + missed), found.jacobian[:-priors])
    np.testing.assert_array_equal(mine[-priors:], found.jacobian[-priors:])


def weighed(bench: Bench, found: Minimum) -> NDArray[np.float64]:
    return weighed_by_misfit(bench.task.problem, found)
