"""Misfit and linear hypotheses against brute force and closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.diagnose.engine.coordinates import Linear, Logarithmic
from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.engine.linear import best_of, log_determinant
from savgs_ident.diagnose.engine.misfit import DISCREPANCY, NOISE_TRUST, misfit_of


def _data(seed: int, rows: int = 400, noise: float = 0.1) -> Data:
    rng = np.random.default_rng(seed)
    reach = rng.uniform(0.5, 2.0, rows)
    return Data(np.zeros(rows), np.full(rows, noise**2), reach, np.arange(rows) // 40)


@pytest.mark.parametrize("miss", [0.0, 0.02, 0.2])
@pytest.mark.parametrize("seed", range(3))
def test_noise_scale_and_discrepancy_are_where_the_density_is_highest(seed: int, miss: float) -> None:
    data = _data(seed)
    rng = np.random.default_rng(seed + 100)
    spread = np.sqrt(1.1**2 * data.variance + (miss * data.reach) ** 2)
    residual = spread * rng.standard_normal(400)
    found = misfit_of(data, residual)

    def density(scale: np.ndarray, discrepancy: np.ndarray) -> np.ndarray:
        variance = scale[..., None] ** 2 * data.variance + (discrepancy[..., None] * data.reach) ** 2
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


def _problem(seed: int) -> tuple[Data, np.ndarray, np.ndarray]:
    data, rng = _data(seed, noise=1.0), np.random.default_rng(seed)
    slopes = rng.standard_normal((400, 3))
    return data, slopes @ np.array([0.5, -1.0, 0.2]) + rng.standard_normal(400), slopes


def test_the_best_point_is_that_of_ridge_regression() -> None:
    data, residual, slopes = _problem(1)
    wide = np.full(3, np.inf)
    top = best_of(data, residual, slopes, np.zeros(3), (-wide, wide))
    weight = 1.0 / top.misfit.spread
    expected = np.linalg.solve(np.eye(3) + (slopes.T * weight) @ slopes, slopes.T @ (weight * residual))
    np.testing.assert_allclose(top.x, expected, rtol=1e-3)
    assert log_determinant(top.precision) == pytest.approx(np.linalg.slogdet(top.precision)[1], rel=1e-12)


def test_it_does_not_depend_on_where_it_was_linearised() -> None:
    data, residual, slopes = _problem(2)
    wide = np.full(3, np.inf)
    here = best_of(data, residual, slopes, np.zeros(3), (-wide, wide))
    start = np.array([0.3, 0.1, -0.4])
    there = best_of(data, residual - slopes @ start, slopes, start, (-wide, wide))
    np.testing.assert_allclose(here.x, there.x, atol=1e-4)
    assert here.value == pytest.approx(there.value, abs=1e-3)


def test_a_bound_is_kept_and_the_others_make_the_best_of_it() -> None:
    data, residual, slopes = _problem(3)
    lower, upper = np.array([-9.0, -0.2, -9.0]), np.full(3, 9.0)
    top = best_of(data, residual, slopes, np.zeros(3), (lower, upper))
    assert top.x[1] == -0.2
    for place in (0, 2):
        for step in (-0.05, 0.05):
            moved = top.x.copy()
            moved[place] += step
            value = misfit_of(data, residual - slopes @ moved).value - 0.5 * moved @ moved
            assert value < top.value


def test_rows_that_are_left_out_do_not_count() -> None:
    data, residual, slopes = _problem(4)
    kept = data.test % 2 == 0
    wide = np.full(3, np.inf)
    top = best_of(data, residual, slopes, np.zeros(3), (-wide, wide), kept)
    spoilt = np.where(kept, residual, 1e3)
    again = best_of(data, spoilt, slopes, np.zeros(3), (-wide, wide), kept)
    np.testing.assert_array_equal(top.x, again.x)


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
    assert compliance.reach == (0.0, pytest.approx(10.0))
    assert compliance.value(-1.0) == 0.0
    assert not Linear("c", "N", 0.0, 1.0).halved
    assert Logarithmic("v", "m/s", 1.0, 0.5, lower=0.0).reach[0] == -np.inf
