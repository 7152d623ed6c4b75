"""The normal approximation that makes a posterior round, on posteriors whose covariance is known."""

from itertools import combinations

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.parameter import Parameter
from savgs_ident.inference.laplace import attainable_evidence, log_evidence, precision_of
from savgs_ident.inference.posterior_mode import LONGEST, nuisance_scale, parameter_scale
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
