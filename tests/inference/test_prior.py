"""Priors against scipy.stats, in the parameters' own values; the same for fit, posterior and diagnosis."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.core.transforms import WIDTH
from savgs_ident.inference.likelihood import values_of
from savgs_ident.inference.prior import Prior, Scales, sheet_coordinate

TABLE = ParameterTable(
    (
        Parameter("between", 0.03, "1", lower=0.01, upper=0.5),
        Parameter("above", 5.0, "m", lower=1.0),
        Parameter("below", -2.0, "m", upper=3.0),
        Parameter("identified and known", 5792.0, "N s/m", tolerance=463.0, lower=0.0),
        Parameter("known", 157e3, "N/m", tolerance=1.6e3, lower=0.0),
    )
)
FREE = FreeVector(TABLE, tuple(TABLE)[:4], ("known",))
TRUE = {
    "above": stats.lognorm(WIDTH, loc=1.0, scale=4.0),
    "identified and known": stats.norm(5792.0, 463.0),
    "known": stats.norm(157e3, 1.6e3),
}
"""What is said of them: log-normal in the distance to the bound, normal where a tolerance is known."""

PRIOR = Prior(FREE)


def _values(us: np.ndarray) -> dict[str, np.ndarray]:
    points = np.concatenate([us, np.zeros((len(us), 2))], axis=1)
    return values_of(FREE, Scales(), points)


def _along(place: int, us: np.ndarray) -> np.ndarray:
    """The log density with one coordinate moved."""
    points = jnp.zeros((us.size, 7)).at[:, place].set(us)
    return np.asarray(jax.vmap(PRIOR)(points))


@pytest.mark.parametrize("name", TRUE)
def test_the_density_of_the_value_is_the_one_that_is_said(name: str) -> None:
    place = FREE.names.index(name)
    us = np.linspace(-4.0, 4.0, 25)
    points = np.zeros((us.size, 5))
    points[:, place] = us
    value = _values(points)[name]
    stretch = np.asarray(jax.vmap(FREE.jacobian_diag)(jnp.asarray(points)))[:, place]
    off = _along(place, us) - np.log(stretch) - TRUE[name].logpdf(value)
    np.testing.assert_allclose(off, off[0], atol=1e-9)


def test_both_scales_have_the_unit_normal() -> None:
    at = np.linspace(-4.0, 4.0, 9)
    for place in (5, 6):
        off = _along(place, at) - stats.norm.logpdf(at)
        np.testing.assert_allclose(off, off[0], atol=1e-12)


@given(share=st.floats(0.001, 0.999))
def test_quantiles_are_those_of_scipy(share: float) -> None:
    found = _values(PRIOR.quantile(share)[None])
    for name, true in TRUE.items():
        assert found[name][0] == pytest.approx(true.ppf(share), rel=1e-9)
    # On the logistic curve, a factor of twenty in the distance to the near bound.
    odds = (found["between"][0] - 0.01) / (0.5 - found["between"][0])
    assert np.log(odds * 0.47 / 0.02) == pytest.approx(WIDTH * stats.norm.ppf(share), rel=1e-9, abs=1e-9)


def test_the_median_is_the_tables_value() -> None:
    found = _values(PRIOR.quantile(0.5)[None])
    for name, value in TABLE.as_dict().items():
        assert found[name][0] == pytest.approx(value)


@given(x=st.floats(-3.0, 3.0))
def test_a_diagnosis_has_the_transform_and_the_prior_of_the_posterior(x: float) -> None:
    coordinates = [sheet_coordinate(parameter) for parameter in FREE.parameters]
    u = jnp.asarray(FREE.widths * x)
    values, slopes = FREE.to_constrained(u), FREE.jacobian_diag(u)
    for each, slope, width in zip(coordinates, slopes, FREE.widths, strict=True):
        assert each.value(x) == pytest.approx(float(values[each.name]), rel=1e-13)
        assert each.slope(x) == pytest.approx(width * float(slope), rel=1e-10)
        assert each.at(each.value(x)) == pytest.approx(x, abs=1e-9)
    assert float(jnp.sum(FREE.prior_residuals(u) ** 2)) == pytest.approx(5.0 * x**2)


def test_only_a_tolerance_is_held_against_a_parameter() -> None:
    assert [sheet_coordinate(each).known for each in FREE.parameters] == [False, False, False, True, True]
