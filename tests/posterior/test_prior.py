"""Priors against scipy.stats, in the parameters' own values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.posterior.prior import prior_of
from savgs_ident.posterior.scales import Scales
from savgs_ident.posterior.values import values_of

TABLE = ParameterTable(
    (
        Parameter("between", 0.03, "1", lower=0.01, upper=0.5),
        Parameter("above", 5.0, "m", lower=1.0),
        Parameter("below", -2.0, "m", upper=3.0),
        Parameter("known", 157e3, "N/m", tolerance=1.6e3, lower=0.0),
    )
)
FREE = FreeVector(TABLE, ("between", "above", "below"), ("known",))
TRUE = {
    "between": stats.uniform(0.01, 0.49),
    "above": stats.fisk(1.0, loc=1.0, scale=4.0),
    "known": stats.norm(157e3, 1.6e3),
}
"""What is said of them: uniform, log-logistic in the distance to the bound, normal."""

PRIOR = prior_of(FREE)


def _values(us: np.ndarray) -> dict[str, np.ndarray]:
    points = np.concatenate([us, np.zeros((len(us), 2))], axis=1)
    return values_of(FREE, Scales(), points)


def _along(place: int, us: np.ndarray) -> np.ndarray:
    """The log density with one coordinate moved."""
    points = jnp.zeros((us.size, 6)).at[:, place].set(us)
    return np.asarray(jax.vmap(PRIOR)(points))


@pytest.mark.parametrize("name", [*TRUE, "below"])
def test_the_density_of_the_value_is_the_one_that_is_said(name: str) -> None:
    place = FREE.names.index(name)
    us = np.linspace(-6.0, 6.0, 25) if name != "known" else np.linspace(-4.0, 4.0, 25)
    points = np.zeros((us.size, 4))
    points[:, place] = us
    value = _values(points)[name]
    stretch = np.asarray(jax.vmap(FREE.jacobian_diag)(jnp.asarray(points)))[:, place]
    distance = stats.fisk(1.0, scale=5.0)
    true = distance.logpdf(3.0 - value) if name == "below" else TRUE[name].logpdf(value)
    off = _along(place, us) - np.log(stretch) - true
    np.testing.assert_allclose(off, off[0], atol=1e-9)


def test_both_scales_have_the_unit_normal() -> None:
    at = np.linspace(-4.0, 4.0, 9)
    for place in (4, 5):
        off = _along(place, at) - stats.norm.logpdf(at)
        np.testing.assert_allclose(off, off[0], atol=1e-12)


@given(share=st.floats(0.001, 0.999))
def test_quantiles_are_those_of_scipy(share: float) -> None:
    found = _values(PRIOR.quantile(share)[None])
    for name, true in TRUE.items():
        assert found[name][0] == pytest.approx(true.ppf(share), rel=1e-9)
    assert found["below"][0] == pytest.approx(3.0 - stats.fisk(1.0, scale=5.0).ppf(1.0 - share), rel=1e-9)


def test_the_median_of_a_one_sided_parameter_is_the_tables_value() -> None:
    found = _values(PRIOR.quantile(0.5)[None])
    assert found["above"][0] == pytest.approx(5.0)
    assert found["below"][0] == pytest.approx(-2.0)


def test_shares_of_drawn_coordinates_are_as_said() -> None:
    # The logistic, less its offset, is what calibration draws identified coordinates from.
    random = np.random.default_rng(5)
    us = np.zeros((4000, 4))
    us[:, 0] = random.logistic(size=4000) - PRIOR.offset[0]
    assert stats.kstest(_values(us)["between"], TRUE["between"].cdf).pvalue > 1e-3
