"""Parameters and tables of them keep their promises."""

import math

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable

TABLE = ParameterTable(
    (Parameter("m_s", 320.0, "kg", 1.6, 0.0), Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5))
)


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1, 0.6])
def test_a_value_that_is_not_finite_or_outside_its_bounds_is_refused(value: float) -> None:
    with pytest.raises(InputError, match="mu_r"):
        Parameter("mu_r", value, "1", lower=0.0, upper=0.5)


@pytest.mark.parametrize("tolerance", [math.nan, math.inf, -1.0])
def test_a_tolerance_is_a_standard_deviation(tolerance: float) -> None:
    with pytest.raises(InputError, match="tolerance"):
        Parameter("m_s", 320.0, "kg", tolerance)


def test_values_are_replaced_and_the_rest_is_kept() -> None:
    changed = TABLE.with_values({"mu_r": 0.1})
    assert changed.as_dict() == {"m_s": 320.0, "mu_r": 0.1}
    assert (changed["mu_r"].upper, changed["m_s"]) == (0.5, TABLE["m_s"])
    assert TABLE["mu_r"].value == 0.03
    with pytest.raises(InputError, match="outside its bounds"):
        TABLE.with_values({"mu_r": 0.7})
    with pytest.raises(InputError, match="no parameter 'mu_x'"):
        TABLE.with_values({"mu_x": 0.7})


def test_a_table_is_a_mapping_in_its_own_order_without_doubles() -> None:
    assert list(TABLE) == ["m_s", "mu_r"]
    assert len(TABLE) == 2
    assert TABLE.values_of(("mu_r", "m_s")) == (0.03, 320.0)
    with pytest.raises(KeyError):
        TABLE["mu_t"]
    with pytest.raises(InputError, match="'m_s' is given twice"):
        TABLE + TABLE
