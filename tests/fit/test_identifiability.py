"""What covariances say in words, on covariances made by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.core.parameter import Parameter
from savgs_ident.fit.estimate import at_bounds
from savgs_ident.fit.identifiability import (
    LARGEST_SD,
    confounded_groups,
    known_combination,
    verdict_of,
)
from savgs_ident.inference.laplace import LARGEST_SPREAD, spread_of

NAMES = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
VALUES = {"mu_r": 0.03, "mu_t": 0.3, "ydot_Hth": 0.06, "c_sd": 5400.0}
UNITS = {"mu_r": "1", "mu_t": "1", "ydot_Hth": "m/s", "c_sd": "N s/m"}


def _covariance(sd: float, *directions: tuple[tuple[float, ...], float]) -> NDArray[np.float64]:
    """Standard deviation ``sd`` in every direction, and more in the ``directions`` given with their own."""
    covariance = sd**2 * np.eye(4)
    for direction, spread in directions:
        unit = np.array(direction) / np.linalg.norm(direction)
        covariance += (spread**2 - sd**2) * np.outer(unit, unit)
    return covariance


def _words(covariance: NDArray[np.float64], bounds: dict[str, float] | None = None) -> str:
    return " ".join(verdict_of(NAMES, VALUES, UNITS, covariance, bounds or {}, (), {}).sentences)


def test_well_identified_parameters_form_no_group_and_are_listed_with_their_errors() -> None:
    covariance = np.diag([0.01, 0.02, 0.03, 0.005]) ** 2
    assert confounded_groups(NAMES, covariance) == ()
    verdict = verdict_of(NAMES, VALUES, UNITS, covariance, {}, (), {})
    assert verdict.identifiable
    assert verdict.confounded == ()
    assert verdict.sentences == (
        "These data identify mu_r to 1 %, mu_t to 2 %, ydot_Hth to 3 %, c_sd to 0.5 %.",
    )


def test_a_pair_that_grows_together_is_known_by_its_ratio() -> None:
    covariance = _covariance(0.01, ((0.0, 1.0, 1.0, 0.0), 30.0))
    assert confounded_groups(NAMES, covariance) == (("mu_t", "ydot_Hth"),)
    verdict = verdict_of(NAMES, VALUES, UNITS, covariance, {"ydot_Hth": 0.043}, ("Do this.",), {})
    assert not verdict.identifiable
    assert verdict.confounded == (("mu_t", "ydot_Hth"),)
    assert verdict.sentences == (
        "These data identify mu_r to 1 %, c_sd to 1 %.",
        "mu_t and ydot_Hth cannot be distinguished: they trade off along a line.",
        "What is known is mu_t/ydot_Hth = 5 1/(m/s), to 1.4 %.",
        "ydot_Hth is at least 0.043 m/s (95 %, profile likelihood).",
        "Do this.",
    )


def test_a_pair_of_which_one_grows_as_the_other_shrinks_is_known_by_its_product() -> None:
    covariance = _covariance(0.01, ((0.0, 1.0, -1.0, 0.0), 30.0))
    name, error = known_combination(("mu_t", "ydot_Hth"), NAMES, covariance)
    assert name == "mu_t x ydot_Hth"
    assert error == pytest.approx(0.01 * np.sqrt(2.0), rel=1e-3)
    assert "mu_t x ydot_Hth = 0.018" in _words(covariance)


def test_a_parameter_without_influence_stands_alone() -> None:
    covariance = _covariance(0.01, ((1.0, 0.0, 0.0, 0.0), LARGEST_SPREAD))
    assert confounded_groups(NAMES, covariance) == (("mu_r",),)
    words = _words(covariance)
    assert "These data do not identify mu_r." in words
    assert "apart" not in words


def test_a_pair_of_which_nothing_is_known_has_no_combination() -> None:
    covariance = _covariance(0.01, ((0.0, 1.0, 0.0, 0.0), 30.0), ((0.0, 0.0, 1.0, 0.0), 20.0))
    assert "What is known" not in _words(covariance)


def test_directions_that_share_a_parameter_make_one_group() -> None:
    covariance = _covariance(0.01, ((1.0, 1.0, 0.0, 0.0), 30.0), ((1.0, -1.0, 1.5, 0.0), 20.0))
    assert confounded_groups(NAMES, covariance) == (("mu_r", "mu_t", "ydot_Hth"),)
    assert "mu_r and mu_t and ydot_Hth cannot be distinguished" in _words(covariance)


def test_two_pairs_are_two_groups() -> None:
    covariance = _covariance(0.01, ((1.0, 0.0, 0.0, 1.0), 30.0), ((0.0, 1.0, 1.0, 0.0), 20.0))
    assert sorted(confounded_groups(NAMES, covariance)) == [("mu_r", "c_sd"), ("mu_t", "ydot_Hth")]


@pytest.mark.parametrize(("share", "reported"), [(0.99, True), (1.01, False)])
def test_the_limit_is_a_share_of_the_value(share: float, reported: bool) -> None:
    covariance = _covariance(0.01, ((0.0, 0.0, 0.0, 1.0), share * LARGEST_SD))
    assert verdict_of(NAMES, VALUES, UNITS, covariance, {}, (), {}).identifiable is reported


def test_what_ended_at_a_bound_is_not_identified_whatever_its_error_is() -> None:
    ended = {"mu_t": "mu_t ended at its upper bound, 1: it would go further, or makes up for something."}
    verdict = verdict_of(NAMES, VALUES, UNITS, _covariance(0.001), {}, (), ended)
    assert not verdict.identifiable
    assert [sentence for sentence in verdict.sentences if "mu_t" in sentence] == [ended["mu_t"]]
    identified = verdict.sentences[0]
    assert all(f"{name} to " in identified for name in NAMES if name != "mu_t")


@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0.01, 3.0))
def test_a_verdict_is_consistent_whatever_the_covariance(seed: int, scale: float) -> None:
    """Identifiable means every standard error is below the limit; a group never overlaps another."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((4, 4)) * 10.0 ** rng.uniform(-3.0, 0.0, (4, 1))
    covariance = scale**2 * root @ root.T
    verdict = verdict_of(NAMES, VALUES, UNITS, covariance, {}, (), {})
    members = [name for group in verdict.confounded for name in group]
    assert len(members) == len(set(members))
    if verdict.identifiable:
        assert np.max(np.sqrt(np.diag(covariance))) <= LARGEST_SD
    if np.max(np.linalg.eigvalsh(covariance)) <= LARGEST_SD**2:
        assert verdict.identifiable


@given(seed=st.integers(0, 2**32 - 1))
def test_the_spread_is_the_inverse_information_where_there_is_some(seed: int) -> None:
    rng = np.random.default_rng(seed)
    jacobian = rng.standard_normal((30, 4)) * 10.0 ** rng.uniform(-2.0, 3.0, 4)
    spread = spread_of(jacobian)
    wanted = np.linalg.inv(jacobian.T @ jacobian)
    size = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    assert np.max(np.abs(spread.covariance - wanted) / size) < 1e-6
    assert spread.sd == pytest.approx(np.sqrt(np.diag(wanted)), rel=1e-6)


def test_a_direction_without_information_has_a_large_spread_and_leaves_the_others_alone() -> None:
    jacobian = np.array([[10.0, -10.0, 0.0], [0.0, 0.0, 5.0]])
    spread = spread_of(jacobian)
    assert spread.sd[2] == pytest.approx(0.2)
    assert spread.sd[:2] == pytest.approx([LARGEST_SPREAD / np.sqrt(2.0)] * 2, rel=1e-6)
    difference = np.array([1.0, -1.0, 0.0])
    assert difference @ spread.covariance @ difference == pytest.approx(0.01, rel=1e-3)


def test_a_jacobian_that_is_not_finite_says_nothing_of_any_parameter() -> None:
    jacobian = np.eye(3)
    jacobian[1, 2] = np.nan
    np.testing.assert_allclose(spread_of(jacobian).sd, LARGEST_SPREAD)


def test_a_value_near_a_bound_is_at_it_and_one_near_zero_is_not() -> None:
    rise = Parameter("rise", 0.1, "1", lower=0.0, upper=5.0)
    shift = Parameter("shift", 0.0, "m", lower=-0.2, upper=0.2)
    free = Parameter("free", 1.0, "kg")
    every = (rise, shift, free)
    assert at_bounds(every, {"rise": 1e-9, "shift": 0.1, "free": 1e9}) == {}
    one = at_bounds(every, {"rise": 4.97, "shift": 0.0, "free": 1.0})["rise"]
    assert one.startswith("rise ended at its upper bound, 5: ")
    other = at_bounds(every, {"rise": 1.0, "shift": -0.1999, "free": 1.0})["shift"]
    assert other.startswith("shift ended at its lower bound, -0.2 m: ")
