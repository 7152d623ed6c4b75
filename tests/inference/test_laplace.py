"""The normal approximation that makes a posterior round, on posteriors whose covariance is known."""

from itertools import combinations

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.parameter import Parameter
from savgs_ident.inference.expansion import LONGEST, nuisance_scale, parameter_scale
from savgs_ident.inference.laplace import (
    LinearisedOptimum,
    attainable_evidence,
    covariance_over_discrepancies,
    linearised_optimum,
    log_evidence,
    precision_of,
)
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import Prior, Scales, sheet_coordinate

from .toy import FIXED_SCALES, FREE, straight_toy
from .toy_reference import reference_of
from .toy_surrogate import mode_of, normal_covariance


def test_its_axes_make_up_the_covariance() -> None:
    toy = straight_toy(scales=FIXED_SCALES, strength=300.0)
    axes = parameter_scale(toy.likelihood, Prior(FREE), jnp.zeros(5), toy.slope)
    np.testing.assert_allclose(axes @ axes.T, normal_covariance(toy), rtol=1e-4, atol=1e-10)
    # The best reported comes first: the shear counts on it.
    assert np.all(np.diff(np.linalg.norm(axes, axis=0)) >= 0.0)


def test_a_direction_without_data_keeps_its_prior_as_far_as_axes_reach() -> None:
    toy = straight_toy(scales=FIXED_SCALES)
    slope = toy.slope.copy()
    slope[:, 1:] = 0.0
    axes = parameter_scale(toy.likelihood, Prior(FREE), jnp.zeros(5), slope)
    covariance = axes @ axes.T
    # The logistic density has curvature 1/2 at its middle, and so a longer axis than there is; the normal one 1.
    assert covariance[1, 1] == pytest.approx(LONGEST**2)
    assert covariance[2, 2] == pytest.approx(1.0)


@pytest.mark.parametrize("miss", [0.0, 0.05])
def test_scales_of_the_noise_and_of_the_discrepancy(miss: float) -> None:
    """Their moments are those of brute force, for parameters that hardly matter to them."""
    toy = straight_toy(miss=miss)
    mode = mode_of(toy)
    rows = toy.rows(mode[None, :-2])[0][0]
    nothing = np.zeros_like(rows)
    means, deviations = nuisance_scale(toy.likelihood, Prior(FREE), jnp.asarray(mode), rows, nothing)
    reference = reference_of(toy, mode)
    if miss:
        assert means[1] == pytest.approx(reference.weight @ reference.points[:, 4], rel=0.1)
        assert deviations[1] == pytest.approx(reference.sd(4), rel=0.25)
    else:
        # Both halves together: no mean, the root of the second moment.
        assert means[1] == 0.0
        assert deviations[1] == pytest.approx(
            np.sqrt(reference.weight @ reference.points[:, 4] ** 2), rel=0.25
        )
    assert deviations[0] == pytest.approx(reference.sd(3), rel=0.15)


def test_a_discrepancy_near_zero_has_more_room_where_parameters_are_not_at_their_best() -> None:
    """As wide as rows scatter besides: with twice the misfit, a discrepancy is as large as the misfit."""
    toy = straight_toy(miss=0.0)
    mode = mode_of(toy)
    rows = toy.rows(mode[None, :-2])[0][0]
    missed = np.abs(rows - np.asarray(toy.likelihood.measured))
    args = toy.likelihood, Prior(FREE), jnp.asarray(mode), rows
    (_, still), (_, anywhere) = (nuisance_scale(*args, scatter) for scatter in (np.zeros_like(rows), missed))
    assert anywhere[1] > 1.2 * still[1]
    assert anywhere[0] == still[0]


def test_scales_without_data_keep_their_prior() -> None:
    toy = straight_toy(scales=Scales(noise_trust=1e-9, discrepancy=1e-12))
    nothing = np.zeros_like(toy.base)
    means, deviations = nuisance_scale(toy.likelihood, Prior(FREE), jnp.zeros(5), toy.base, nothing)
    np.testing.assert_allclose(means, 0.0, atol=1e-6)
    np.testing.assert_allclose(deviations, 1.0, rtol=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_no_choice_among_coordinates_comes_to_more_than_what_is_attainable_if_they_cost_nothing(
    seed: int,
) -> None:
    random, kept, count = np.random.default_rng(seed), 2, 6
    coordinates = tuple(sheet_coordinate(Parameter(name, 1.0, "1", tolerance=1.0)) for name in "abcdef")
    slopes = random.standard_normal((20, count)) * np.geomspace(0.1, 10.0, count)
    measured = slopes[:, :3] @ random.standard_normal(3) + random.standard_normal(20)

    def fitted(chosen: list[int]) -> tuple[float, np.ndarray, np.ndarray]:
        some = slopes[:, chosen]
        precision = precision_of(some, np.ones(20))
        x = np.linalg.solve(precision, some.T @ measured)
        return -0.5 * float(np.sum((measured - some @ x) ** 2) + x @ x), x, precision

    free = np.arange(count) >= kept
    bound = attainable_evidence(*fitted(list(range(count))), coordinates, free)
    weights = []
    for size in range(count - kept + 1):
        for some in combinations(range(kept, count), size):
            value, _, precision = fitted([*range(kept), *some])
            weights.append(log_evidence(value, precision, coordinates[: kept + size]))
    assert max(weights) < bound
    value, x, precision = fitted(list(range(count)))
    none = np.zeros(count, bool)
    assert attainable_evidence(value, x, precision, coordinates, none) == weights[-1]
    # It says more than the likelihood alone.
    assert bound < weights[-1] + 0.5 * np.linalg.slogdet(precision)[1] + 0.5 * float(x @ x)


ANYWHERE = (np.full(2, -np.inf), np.full(2, np.inf))


def _few_rows(discrepancy_scale: float) -> Data:
    """Rows of noise one, twelve of them, that a discrepancy of one changes by so much."""
    twelve = np.ones(12)
    return Data(
        np.zeros(12),
        twelve,
        discrepancy_scale * twelve,
        np.zeros(12, np.intp),
        Scales(1e-6, discrepancy=0.002),
    )


def _best(data: Data, residual: np.ndarray, slopes: np.ndarray) -> LinearisedOptimum:
    return linearised_optimum(data, residual, slopes, np.zeros(2), ANYWHERE)


def test_where_nothing_can_be_a_discrepancy_the_covariance_is_that_of_the_best_point() -> None:
    random = np.random.default_rng(1)
    data, slopes, residual = _few_rows(0.0), random.standard_normal((12, 2)), random.standard_normal(12)
    best = _best(data, residual, slopes)
    found = covariance_over_discrepancies(data, residual - slopes @ best.x, slopes, best.x, best.noise_scales)
    np.testing.assert_allclose(found, np.linalg.inv(best.precision), rtol=1e-6)


def test_the_covariance_over_discrepancies_is_that_of_brute_force() -> None:
    """The posterior of both coordinates and the discrepancy on a grid of points, for one set of rows."""
    random = np.random.default_rng(3)
    data, slopes = _few_rows(1000.0), random.standard_normal((12, 2))
    residual = slopes @ [0.5, -1.0] + random.standard_normal(12)
    best = _best(data, residual, slopes)
    found = covariance_over_discrepancies(data, residual - slopes @ best.x, slopes, best.x, best.noise_scales)
    axis, misses = np.linspace(-5.0, 5.0, 81), np.linspace(0.0, 0.012, 121)
    one, other, miss = np.meshgrid(axis, axis, misses, indexing="ij")
    spread = best.noise_scales.noise**2 + (1000.0 * miss) ** 2
    squares = sum(
        (row - slope[0] * one - slope[1] * other) ** 2 for row, slope in zip(residual, slopes, strict=True)
    )
    logs = -0.5 * (squares / spread + 12.0 * np.log(spread) + one**2 + other**2 + (miss / 0.002) ** 2)
    mass = np.exp(logs - logs.max())
    mass[:, :, 0] *= 0.5
    off = np.stack([one - best.x[0], other - best.x[1]]).reshape(2, -1)
    expected = (off * mass.ravel()) @ off.T / mass.sum()
    np.testing.assert_allclose(found, expected, rtol=0.01)


def test_errors_over_all_discrepancies_hold_the_truth_as_often_as_they_say() -> None:
    """Rows that share an error of a size from its prior: where the best size is zero, its errors are too small."""
    random, slopes = np.random.default_rng(5), np.random.default_rng(6).standard_normal((12, 2))
    data = _few_rows(3000.0)
    over_all, at_best = [], []
    for _ in range(400):
        truth, miss = random.standard_normal(2), 0.002 * abs(random.standard_normal())
        residual = slopes @ truth + np.hypot(1.0, 3000.0 * miss) * random.standard_normal(12)
        best = _best(data, residual, slopes)
        found = covariance_over_discrepancies(
            data, residual - slopes @ best.x, slopes, best.x, best.noise_scales
        )
        off = (best.x - truth) ** 2
        over_all.append(off / np.diag(found))
        at_best.append(off / np.diag(np.linalg.inv(best.precision)))
    assert np.mean(over_all) == pytest.approx(1.0, abs=0.12)
    assert np.mean(at_best) > 1.2
