"""What is said of a fit whose model lacks something."""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.fit.identifiability import CHANCE, EXPLAINED, assess, weighed_by_misfit
from savgs_ident.fit.minimise import Minimum
from savgs_ident.inference.laplace import spread_of
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
    verdict = assess(bench.task, bench.minimiser, found, silent)
    first = verdict.sentences[0]
    assert first.startswith("The model does not explain these data")
    assert f"chi2/dof = {excess:.3g}" in first
    assert "`diagnose`" in first
    assert not verdict.explained


def test_a_model_that_errs_little_is_trusted_with_errors_that_contain_it(bench: Bench) -> None:
    """Deflection read 0.4 % too large stands out of the noise, and is no more than any model errs by."""
    data = bench.predicted(TRUTH) + bench.noise(4)
    data[:, 1] *= 1.004
    found = bench.fit(data)
    verdict = assess(bench.task, bench.minimiser, found, silent)
    assert verdict.explained
    sizes = [np.sqrt(np.diag(spread_of(each).covariance)) for each in (found.jacobian, weighed(bench, found))]
    assert (sizes[1] >= sizes[0]).all()


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
