"""Misfit and linear hypotheses against brute force and closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from savgs_ident.inference.laplace import linearised_optimum, log_determinant
from savgs_ident.inference.likelihood import noise_scales
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import Linear, Logarithmic, Scales

from ..in_one_test import over

NOISE_TRUST, DISCREPANCY = Scales()


def _data(seed: int, rows: int = 400, noise: float = 0.1) -> Data:
    rng = np.random.default_rng(seed)
    reach = rng.uniform(0.5, 2.0, rows)
    return Data(np.zeros(rows), np.full(rows, noise**2), reach, np.arange(rows) // 40)


@over("miss", [0.0, 0.02, 0.2])
@over("seed", range(3))
def test_noise_scale_and_discrepancy_are_where_the_density_is_highest(seed: int, miss: float) -> None:
    data = _data(seed)
    rng = np.random.default_rng(seed + 100)
    spread = np.sqrt(1.1**2 * data.variance + (miss * data.discrepancy_scale) ** 2)
    residual = spread * rng.standard_normal(400)
    found = noise_scales(data, residual)

    def density(scale: np.ndarray, discrepancy: np.ndarray) -> np.ndarray:
        variance = (
            scale[..., None] ** 2 * data.variance + (discrepancy[..., None] * data.discrepancy_scale) ** 2
        )
        rows = -0.5 * (np.log(variance / data.variance) + residual**2 / variance)
        return (
            rows.sum(-1) - 0.5 * (np.log(scale) / NOISE_TRUST) ** 2 - 0.5 * (discrepancy / DISCREPANCY) ** 2
        )

    assert found.value == pytest.approx(
        float(density(np.array(found.noise), np.array(found.discrepancy))), abs=1e-9
    )
    best = max(density(np.full(401, s), np.linspace(0.0, 0.4, 401)).max() for s in np.linspace(0.8, 1.6, 81))
    assert found.value > best - 1e-3
    if miss == 0.2:
        assert found.discrepancy == pytest.approx(miss, rel=0.15)


@pytest.mark.slow
@over("rows", [10, 30, 400])
@over("understated", [5.0, 10.0])
@over("reach", [0.0, 1.0, 10.0])
def test_scales_are_found_where_residuals_far_exceed_the_noise(
    rows: int, understated: float, reach: float
) -> None:
    """Undamped steps swing to and fro there: of 30 rows with a fifth of the noise they made a scale of 1.89."""
    rng = np.random.default_rng(1)
    data = Data(
        np.zeros(rows), np.ones(rows), reach * rng.uniform(0.5, 2.0, rows), np.zeros(rows, dtype=np.intp)
    )
    residual = understated * rng.standard_normal(rows)
    found = noise_scales(data, residual)
    assert found.converged
    scale, discrepancy = np.geomspace(0.5, 12.0, 240)[:, None, None], np.linspace(0.0, 1.5, 101)[:, None]
    variance = scale**2 * data.variance + (discrepancy * data.discrepancy_scale) ** 2
    density = (
        -0.5 * (np.log(variance / data.variance) + residual**2 / variance).sum(-1)
        - 0.5 * (np.log(scale) / NOISE_TRUST)[..., 0] ** 2
        - 0.5 * (discrepancy / DISCREPANCY)[..., 0] ** 2
    )
    assert found.value > density.max() - 1e-9
    assert found.value == pytest.approx(density.max(), abs=0.5)


def test_a_search_that_cannot_converge_says_so() -> None:
    data = _data(1)
    residual = np.where(np.arange(400) == 7, np.nan, 0.1)
    assert not noise_scales(data, residual).converged


def test_a_coordinate_that_is_held_for_a_while_is_let_go() -> None:
    """The first step overshoots in both; with the one at its bound, the other is best inside again."""
    rng = np.random.default_rng(5)
    base = rng.standard_normal((400, 1))
    slopes = np.concatenate([base + 0.05 * rng.standard_normal((400, 1)), base], axis=1)
    data = Data(np.zeros(400), np.ones(400), np.ones(400), np.zeros(400, dtype=np.intp))
    residual = slopes @ np.array([4.0, -3.0]) + rng.standard_normal(400)
    bounds = np.array([-0.5, -0.5]), np.array([0.9, 5.0])
    top = linearised_optimum(data, residual, slopes, np.zeros(2), bounds)
    assert top.converged
    true = lsq_linear(
        np.concatenate([slopes / np.sqrt(top.noise_scales.spread)[:, None], np.eye(2)]),
        np.concatenate([residual / np.sqrt(top.noise_scales.spread), np.zeros(2)]),
        bounds,
        method="bvls",
    ).x
    np.testing.assert_allclose(top.x, true, atol=1e-3)


def _problem(seed: int) -> tuple[Data, np.ndarray, np.ndarray]:
    data, rng = _data(seed, noise=1.0), np.random.default_rng(seed)
    slopes = rng.standard_normal((400, 3))
    return data, slopes @ np.array([0.5, -1.0, 0.2]) + rng.standard_normal(400), slopes


def test_the_best_point_is_that_of_ridge_regression() -> None:
    data, residual, slopes = _problem(1)
    wide = np.full(3, np.inf)
    top = linearised_optimum(data, residual, slopes, np.zeros(3), (-wide, wide))
    weight = 1.0 / top.noise_scales.spread
    expected = np.linalg.solve(np.eye(3) + (slopes.T * weight) @ slopes, slopes.T @ (weight * residual))
    np.testing.assert_allclose(top.x, expected, rtol=1e-3)
    assert log_determinant(top.precision) == pytest.approx(np.linalg.slogdet(top.precision)[1], rel=1e-12)


def test_it_does_not_depend_on_where_it_was_linearised() -> None:
    data, residual, slopes = _problem(2)
    wide = np.full(3, np.inf)
    here = linearised_optimum(data, residual, slopes, np.zeros(3), (-wide, wide))
    start = np.array([0.3, 0.1, -0.4])
    there = linearised_optimum(data, residual - slopes @ start, slopes, start, (-wide, wide))
    np.testing.assert_allclose(here.x, there.x, atol=1e-4)
    assert here.value == pytest.approx(there.value, abs=1e-3)


def test_a_bound_is_kept_and_the_others_make_the_best_of_it() -> None:
    data, residual, slopes = _problem(3)
    lower, upper = np.array([-9.0, -0.2, -9.0]), np.full(3, 9.0)
    top = linearised_optimum(data, residual, slopes, np.zeros(3), (lower, upper))
    assert top.x[1] == -0.2
    for place in (0, 2):
        for step in (-0.05, 0.05):
            moved = top.x.copy()
            moved[place] += step
            value = noise_scales(data, residual - slopes @ moved).value - 0.5 * moved @ moved
            assert value < top.value


@given(st.floats(-5.0, 5.0), st.floats(0.1, 3.0), st.floats(-2.0, 2.0))
def test_coordinates_and_values_are_each_others_inverse(x: float, scale: float, centre: float) -> None:
    for coordinate in (Linear("k", "N/m", centre, scale), Logarithmic("v", "m/s", np.exp(centre), scale)):
        assert coordinate.at(coordinate.value(x)) == pytest.approx(x, abs=1e-8)
        step = 1e-6
        slope = (coordinate.value(x + step) - coordinate.value(x - step)) / (2.0 * step)
        assert coordinate.slope(x) == pytest.approx(slope, rel=1e-5, abs=1e-9)


def test_bounds_hold_and_an_amplitude_that_begins_at_its_null_has_half_a_prior() -> None:
    compliance = Linear("C", "m/N", 0.0, 1e-6, lower=0.0, upper=1e-5)
    assert compliance.halved
    assert compliance.bounds == (0.0, pytest.approx(10.0))
    assert compliance.value(-1.0) == 0.0
    assert not Linear("c", "N", 0.0, 1.0).halved
    assert Logarithmic("v", "m/s", 1.0, 0.5, lower=0.0).bounds[0] == -np.inf
