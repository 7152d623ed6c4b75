"""A fit carries the small errors that every model has, and says where they would have to be large."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.fit.small_errors import FitWithErrors, LargeErrors, fit_with_errors
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.inference.background.shared_errors import time_of
from savgs_ident.inference.laplace import spread_of

from .bench import TRUTH, Bench, silent


def _fitted(bench: Bench, data: NDArray[np.complex128]) -> tuple[NDArray[np.float64], object]:
    """Standard deviations of least squares for noise alone [1], and the fit with a background."""
    minimiser = bench.seeing(data)
    task = bench.task._replace(problem=minimiser.problem)
    best = bench.fit(data)
    return spread_of(best.jacobian).sd, fit_with_errors(task, minimiser, best, silent)


def _true(bench: Bench) -> NDArray[np.float64]:
    values = dict(bench.task.table.as_dict()) | dict(TRUTH)
    return np.asarray(bench.u(values))


@pytest.mark.slow
def test_where_there_is_noise_alone_the_errors_are_larger_than_it_and_hold_the_truth(bench: Bench) -> None:
    sd, found = _fitted(bench, bench.predicted(TRUTH) + bench.noise(4))
    assert isinstance(found, FitWithErrors)
    whole, own = (np.sqrt(np.diag(each)) for each in (found.covariance, found.own))
    assert np.all(whole > sd)
    assert np.all(own < whole)
    assert np.all(np.abs(np.asarray(found.best.u) - _true(bench)) < 3.0 * whole)
    np.testing.assert_allclose(np.linalg.inv(found.information.T @ found.information), found.covariance)


@pytest.mark.slow
def test_a_friction_that_drifts_is_found_in_the_middle_of_its_drift(bench: Bench) -> None:
    """Rail friction falls by 6 % while dwells are recorded from slow to fast: least squares takes it for a bend."""
    time = time_of(bench.task.measured.times)
    by_dwell = [
        bench.predicted({**TRUTH, "mu_r": TRUTH["mu_r"] * (1.0 - 0.03 * at)})[d] for d, at in enumerate(time)
    ]
    data = np.stack(by_dwell) + bench.noise(5)
    best = bench.fit(data)
    sd, found = _fitted(bench, data)
    assert isinstance(found, FitWithErrors)
    off = (np.asarray(found.best.u) - _true(bench)) / np.sqrt(np.diag(found.covariance))
    taken_for_noise = (np.asarray(best.u) - _true(bench)) / sd
    assert np.max(np.abs(taken_for_noise)) > 5.0
    assert np.max(np.abs(off)) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("channel", [0, 1])
def test_a_sensor_that_reads_three_per_cent_too_much_is_no_small_error(bench: Bench, channel: int) -> None:
    data = bench.predicted(TRUTH) + bench.noise(4)
    data[:, channel] *= 1.03
    _, found = _fitted(bench, data)
    assert isinstance(found, LargeErrors)
    assert found.error > BACKGROUND.largest_error


@pytest.mark.slow
def test_noise_of_many_times_what_the_recordings_show_is_none(bench: Bench) -> None:
    _, found = _fitted(bench, bench.predicted(TRUTH) + 2.0 * bench.noise(4))
    assert isinstance(found, FitWithErrors)
    _, found = _fitted(bench, bench.predicted(TRUTH) + 2.0 * BACKGROUND.noisiest * bench.noise(4))
    assert isinstance(found, LargeErrors)


def test_what_did_not_end_has_no_background(bench: Bench) -> None:
    data = bench.predicted(TRUTH)
    best = bench.fit(data)
    lost = best._replace(evaluation=type(best.evaluation).NOT_FINITE, u=jnp.full(best.u.shape, jnp.nan))
    assert fit_with_errors(bench.task, bench.minimiser, lost, silent) is None
