"""The free vector: round trips, values inside the bounds, slopes, priors."""

from collections.abc import Callable
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from jax.test_util import check_grads

from savgs_ident.core.errors import InputError
from savgs_ident.core.free_vector import FreeVector, known_to_tolerance
from savgs_ident.core.parameter import TYPICAL, Parameter, ParameterTable
from savgs_ident.core.transforms import (
    WIDTH,
    AbstractBijection,
    identified_bijection,
    prior_width,
    tolerated_bijection,
    transform_of,
)
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over

IDENTIFIED = {
    "rail friction": Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5),
    "near the lower bound": Parameter("ydot_Hth", 0.0011, "m/s", lower=0.001, upper=1.0),
    "near the upper bound": Parameter("efficiency", 0.9999, "1", lower=0.0, upper=1.0),
    "on the lower bound": Parameter("mu_r", 0.0, "1", lower=0.0, upper=0.5),
    "on the upper bound": Parameter("efficiency", 1.0, "1", lower=0.0, upper=1.0),
    "damping": Parameter("c_sd", 5792.0, "N s/m", lower=0.0),
    "compliance from null": Parameter("mount", 0.0, "m/N", tolerance=1e-6, lower=0.0),
    "below an upper bound": Parameter("x", -3.0, "m", upper=-1.0),
    "no bounds": Parameter("y", -0.4, "m"),
    "no bounds, at zero": Parameter("offset", 0.0, "rad", tolerance=0.01),
    "symmetric": Parameter("asymmetry", 0.0, "1", lower=-1.0, upper=1.0),
}
TOLERATED = {
    "no bounds": Parameter("A_y", 0.2245, "m", tolerance=3e-4),
    "far from the bound": Parameter("m_s", 320.0, "kg", tolerance=1.6, lower=0.0),
    "near the lower bound": Parameter("c_t", 300.0, "N s/m", tolerance=150.0, lower=0.0),
    "near the upper bound": Parameter("efficiency", 0.94, "1", tolerance=0.0282, lower=0.01, upper=1.0),
}
TYPICAL_NUMBERS = {
    "above zero": Parameter("k_pre", 6e3, "N/m", tolerance=3e3, lower=0.0, source=TYPICAL),
    "within bounds": Parameter("c_pre", 60.0, "N s/m", lower=1.0, upper=1e3, source=TYPICAL),
}
CASES = [(p, identified_bijection) for p in IDENTIFIED.values()]
CASES += [(p, tolerated_bijection) for p in TOLERATED.values()]
CASES += [(p, transform_of) for p in TYPICAL_NUMBERS.values()]
NAMES = [f"identified, {name}" for name in IDENTIFIED] + [f"tolerated, {name}" for name in TOLERATED]
NAMES += [f"typical, {name}" for name in TYPICAL_NUMBERS]


class Case:
    """A parameter with its map and the map's slope, compiled once for all examples."""

    def __init__(self, parameter: Parameter, make: Callable[[Parameter], AbstractBijection]) -> None:
        bijection = make(parameter)
        self.parameter, self.bijection, self.inverse = parameter, bijection, bijection.inverse
        self.forward, self.slope = jax.jit(bijection.forward), jax.jit(jax.grad(bijection.forward))


every_case = over("case", [Case(*case) for case in CASES], ids=NAMES)


@every_case
@given(u=st.floats(-12.0, 12.0))
def test_round_trip_and_strictly_inside(case: Case, u: float) -> None:
    value = float(case.forward(u))
    assert case.parameter.lower < value < case.parameter.upper
    # What one rounding of the value amounts to in u is the most that can be lost.
    lost = 8.0 * np.spacing(abs(value)) / float(case.slope(u))
    assert case.inverse(value) == pytest.approx(u, abs=1e-12 + lost)


@every_case
def test_at_the_extremes_no_value_leaves_its_range(case: Case) -> None:
    for u in (-1e4, -40.0, 40.0, 1e4):
        assert case.parameter.lower <= float(case.forward(u)) <= case.parameter.upper
        assert not np.isnan(case.slope(u))


@every_case
@given(ends=st.tuples(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0)))
def test_increasing(case: Case, ends: tuple[float, float]) -> None:
    low, high = sorted(ends)
    assume(high - low > 1e-3)
    assert float(case.forward(low)) < float(case.forward(high))


@pytest.mark.slow
@every_case
def test_the_slope_is_that_of_finite_differences(case: Case) -> None:
    points = jnp.array([-3.3, -1.01, -0.2, 0.0, 0.7, 1.9, 4.1])
    scaled = jax.jit(lambda u: jax.vmap(case.forward)(u) / case.slope(0.0))
    check_grads(scaled, (points,), order=2, modes=("fwd",), rtol=1e-5, eps=1e-5)


@every_case
def test_numbers_go_the_same_way_as_arrays(case: Case) -> None:
    for u in (-6.0, -1.3, 0.0, 0.4, 9.0):
        assert float(case.bijection.forward(u)) == pytest.approx(float(case.forward(u)), rel=1e-13)
        assert case.bijection.slope(u) == pytest.approx(float(case.slope(u)), rel=1e-9)


@every_case
def test_zero_is_the_table_value(case: Case) -> None:
    parameter, value = case.parameter, float(case.forward(0.0))
    if parameter.lower < parameter.value < parameter.upper:
        assert value == pytest.approx(parameter.value, rel=1e-12, abs=1e-300)
    else:
        room = 0.5 if parameter.name == "mu_r" else parameter.tolerance or 1.0
        assert abs(value - parameter.value) == pytest.approx(0.01 * room, rel=1e-9)


def test_a_tolerance_is_its_own_unit_up_to_half_way_to_a_bound() -> None:
    tyre = TOLERATED["near the lower bound"]
    bijection = tolerated_bijection(tyre)
    for u in (-1.0, -0.5, 0.0, 2.0, 7.0):
        assert float(bijection.forward(jnp.asarray(u))) == pytest.approx(300.0 + 150.0 * u, rel=1e-14)
    assert 300.0 - 150.0 * 1.5 < float(bijection.forward(jnp.asarray(-1.5))) < 150.0


def test_a_typical_number_is_known_to_an_order_of_magnitude() -> None:
    number = TYPICAL_NUMBERS["above zero"]
    assert prior_width(number) == 1.0
    found = [float(transform_of(number).forward(u)) for u in (-1.0, 0.0, 1.0)]
    assert found == pytest.approx([6e2, 6e3, 6e4], rel=1e-12)
    # At zero, or below, nothing says how large it is.
    assert not replace(number, value=0.0).is_typical
    assert known_to_tolerance(ParameterTable((*TYPICAL_NUMBERS.values(),))) == ("k_pre", "c_pre")


def test_near_a_bound_the_steps_of_an_identified_parameter_are_relative() -> None:
    bijection = identified_bijection(IDENTIFIED["damping"])
    assert float(bijection.forward(jnp.asarray(-2.0))) == pytest.approx(5792.0 * np.exp(-2.0), rel=1e-14)
    friction = identified_bijection(Parameter("mu_r", 1e-6, "1", lower=0.0, upper=0.5))
    assert float(friction.forward(jnp.asarray(1.0))) == pytest.approx(1e-6 * np.e, rel=1e-5)


def _free(rig: Rig) -> FreeVector:
    names = ("mu_r", "c_sd", "mu_t", "ydot_Hth")
    return FreeVector(rig.parameters, names, known_to_tolerance(rig.parameters, names))


def test_the_rig_starts_at_zero_and_comes_back(rig: Rig) -> None:
    free = _free(rig)
    assert free.names[:4] == ("mu_r", "c_sd", "mu_t", "ydot_Hth")
    assert "c_sd" not in free.tolerated
    assert "k_t" in free.tolerated
    assert not {"g", "r_free", "cg_K_y"} & set(free.names)
    u = free.to_unconstrained(rig.parameters.as_dict())
    np.testing.assert_allclose(u, 0.0, atol=1e-12)
    values = jax.jit(free.to_constrained)(u)
    for name in free.names:
        assert float(values[name]) == pytest.approx(rig.parameters[name].value, rel=1e-12)


def test_the_jacobian_is_that_of_the_whole_map(rig: Rig) -> None:
    free = _free(rig)
    u = jax.random.normal(jax.random.key(3), (len(free.names),))
    full = jax.jit(jax.jacfwd(lambda x: jnp.stack(list(free.to_constrained(x).values()))))(u)
    np.testing.assert_allclose(jnp.diag(jax.jit(free.jacobian_diag)(u)), full, rtol=1e-13, atol=0.0)


def test_it_goes_through_jit_and_vmap(rig: Rig) -> None:
    free = FreeVector(rig.parameters, ("mu_r", "c_sd"), ("k_t",))
    starts = jnp.array([[0.0, 0.1, -0.2], [1.0, -1.0, 2.0]])

    @jax.jit
    def values(vector: FreeVector, u: jax.Array) -> jax.Array:
        return jax.vmap(lambda one: jnp.stack(list(vector.to_constrained(one).values())))(u)

    for start, row in zip(starts, values(free, starts), strict=True):
        np.testing.assert_allclose(row, list(free.to_constrained(start).values()), rtol=1e-14)


def test_the_prior_is_the_unit_normal_of_the_tolerances_and_wide_without_one(rig: Rig) -> None:
    free = FreeVector(rig.parameters, ("mu_r", "c_sd"), ("k_t", "m_s"))
    values = {"mu_r": 0.1, "c_sd": 5792.0 - 463.36, "k_t": 275e3 - 2.0 * 13750.0, "m_s": 320.0 + 1.6}
    friction = np.log(0.1 / 0.4) - np.log(0.03 / 0.47)
    found = free.prior_residuals(free.to_unconstrained(values))
    np.testing.assert_allclose(found, [friction / WIDTH, -1.0, -2.0, 1.0], rtol=1e-12)


def test_a_tolerance_about_a_bound_is_no_more_than_a_scale() -> None:
    assert prior_width(IDENTIFIED["compliance from null"]) == WIDTH
    assert prior_width(TOLERATED["no bounds"]) == 1.0


def test_a_start_on_a_bound_is_moved_inside(rig: Rig) -> None:
    free = FreeVector(rig.parameters, ("mu_r",))
    u = free.to_unconstrained({"mu_r": 0.0})
    assert float(free.to_constrained(u)["mu_r"]) == pytest.approx(0.005, rel=1e-12)
    assert float(free.jacobian_diag(u)[0]) > 1e-3


def test_faults_are_named(rig: Rig) -> None:
    table = rig.parameters
    with pytest.raises(InputError, match="there is no parameter 'mu_x'"):
        FreeVector(table, ("mu_x",))
    with pytest.raises(InputError, match="'mu_r' is free twice"):
        FreeVector(table, ("mu_r", "mu_r"))
    with pytest.raises(InputError, match="'g' has no tolerance"):
        FreeVector(table, (), ("g",))
    with pytest.raises(InputError, match="'mu_r' is missing"):
        FreeVector(table, ("mu_r",)).to_unconstrained({})
    with pytest.raises(InputError, match="outside its bounds"):
        FreeVector(table, ("mu_r",)).to_unconstrained({"mu_r": 0.6})
    with pytest.raises(InputError, match="its value is a bound"):
        tolerated_bijection(IDENTIFIED["compliance from null"])
    for parameter in (Parameter("a", 0.0, "1", lower=0.0), Parameter("b", 0.0, "1")):
        with pytest.raises(InputError, match="nothing gives the scale"):
            FreeVector(ParameterTable((parameter,)), (parameter.name,))


def test_the_known_parameters_follow_the_table() -> None:
    entries = tuple(TOLERATED.values())
    table = ParameterTable((entries[1], replace(entries[0], tolerance=0.0), entries[2]))
    assert known_to_tolerance(table) == ("m_s", "c_t")
    assert known_to_tolerance(table, ("m_s",)) == ("c_t",)
