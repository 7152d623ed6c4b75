"""k_eq, c_eq and alpha: against the linkage moved by hand, and against what the paper prints."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from savgs_ident.control.linear_equivalent import Equivalent, equivalents
from savgs_ident.control.two_masses import nominal_equivalent
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

from .by_hand import length, slope, travel, wishbone_at_length, wishbone_at_travel

wishbones = st.floats(-0.15, 0.15)
links = st.floats(0.0, np.pi)


def _equivalent(model: QuarterCar, p: Values, wishbone: float, link: float) -> Equivalent:
    found = equivalents(model, p, jnp.asarray([wishbone]), jnp.asarray([link]))
    return Equivalent(*(float(part[0]) for part in found))


def _length_at_travel(p: Values, at: float, link: float) -> float:
    return length(p, wishbone_at_travel(p, at), link)


@settings(max_examples=15)
@given(wishbone=wishbones, link=links)
def test_alpha_is_how_far_the_wheel_rises_per_link_angle_at_constant_strut_length(
    frictionless: QuarterCar, numbers: Values, wishbone: float, link: float
) -> None:
    held = length(numbers, wishbone, link)

    def wheel(angle: float) -> float:
        return travel(numbers, wishbone_at_length(numbers, held, angle))

    found = _equivalent(frictionless, numbers, wishbone, link).alpha
    assert found == pytest.approx(slope(wheel, link, 2e-3), abs=1e-9)


@settings(max_examples=15)
@given(wishbone=wishbones, link=links)
def test_the_ratio_is_how_much_the_strut_shortens_per_wheel_travel(
    frictionless: QuarterCar, numbers: Values, wishbone: float, link: float
) -> None:
    by_hand = slope(lambda at: -_length_at_travel(numbers, at, link), travel(numbers, wishbone), 1e-3)
    found = _equivalent(frictionless, numbers, wishbone, link)
    assert found.ratio == pytest.approx(by_hand, rel=1e-8)


@settings(max_examples=15)
@given(wishbone=wishbones, link=links)
def test_k_eq_is_the_curvature_of_the_energy_in_the_spring_over_wheel_travel(
    frictionless: QuarterCar, numbers: Values, wishbone: float, link: float
) -> None:
    """A constant static load bends nothing: all the stiffness at the wheel is in the spring's energy."""

    def energy(at: float) -> float:
        squeeze = float(numbers["l_free"]) - _length_at_travel(numbers, at, link)
        return float(numbers["k_sd"]) * squeeze**2 / 2.0

    def force(at: float) -> float:
        return slope(energy, at, 2e-3)

    found = _equivalent(frictionless, numbers, wishbone, link).k_eq
    assert found == pytest.approx(slope(force, travel(numbers, wishbone), 2e-3), rel=1e-6)


@settings(max_examples=15)
@given(wishbone=wishbones, link=links, velocity=st.floats(0.01, 1.0))
def test_c_eq_takes_at_the_wheel_the_power_that_the_damper_takes(
    frictionless: QuarterCar, numbers: Values, wishbone: float, link: float, velocity: float
) -> None:
    start = travel(numbers, wishbone)
    shortens = slope(lambda t: -_length_at_travel(numbers, start + velocity * t, link), 0.0, 1e-3 / velocity)
    found = _equivalent(frictionless, numbers, wishbone, link).c_eq
    assert found * velocity**2 == pytest.approx(float(numbers["c_sd"]) * shortens**2, rel=1e-7)


def test_the_nominal_numbers_are_those_of_the_paper(friction: QuarterCar, numbers: Values) -> None:
    """The hardpoints were designed to meet them: within 1 %."""
    at = nominal_equivalent(friction, numbers)
    assert float(at.k_eq) == pytest.approx(59987.0, rel=0.01)
    assert float(at.c_eq) == pytest.approx(2087.4, rel=0.01)


@given(link=st.floats(np.radians(2.0), np.radians(178.0)))
def test_alpha_is_negative_while_the_link_turns_upward(
    frictionless: QuarterCar, numbers: Values, link: float
) -> None:
    assert _equivalent(frictionless, numbers, 0.0, link).alpha < 0.0
    assert _equivalent(frictionless, numbers, 0.0, -link).alpha > 0.0


@given(wishbone=wishbones, side=st.sampled_from([0.0, 1.0]))
def test_alpha_vanishes_where_link_and_strut_are_in_line(
    frictionless: QuarterCar, numbers: Values, wishbone: float, side: float
) -> None:
    """There the strut's length is greatest or least: eye, pivot and crank pin lie on one line."""
    pivot = np.array([float(numbers["G_y"]), float(numbers["G_z"])])
    hinge = np.array([float(numbers["A_y"]), float(numbers["A_z"])])
    arm = np.array([float(numbers["E_y"]), float(numbers["E_z"])]) - hinge
    turn = np.array([[np.cos(wishbone), -np.sin(wishbone)], [np.sin(wishbone), np.cos(wishbone)]])
    away = pivot - (hinge + turn @ arm)
    in_line = np.arctan2(away[1], away[0]) - float(numbers["theta_0"]) + side * np.pi
    found = _equivalent(frictionless, numbers, wishbone, in_line)
    assert found.alpha == pytest.approx(0.0, abs=1e-15)
    reach = np.hypot(*away) + (1.0 - 2.0 * side) * float(numbers["l_SL"])
    assert length(numbers, wishbone, in_line) == pytest.approx(reach, rel=1e-14)


def test_alpha_and_k_eq_are_those_of_the_linkage_whatever_the_friction(
    frictionless: QuarterCar, friction: QuarterCar, numbers: Values
) -> None:
    angles = jnp.linspace(0.2, 2.9, 12)
    with_it, without = (
        equivalents(model, numbers, 0.02 * angles, angles) for model in (friction, frictionless)
    )
    for one, other in zip(with_it, without, strict=True):
        assert np.array_equal(one, other)
