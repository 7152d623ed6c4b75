"""From link angle to z_lin: near the exact alpha, and its integral."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from savgs_ident.control.alpha_map import RANGE, AlphaMap, alpha_map
from savgs_ident.control.linear_equivalent import equivalents
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

from .by_hand import length, travel, wishbone_at_length


@pytest.fixture(scope="module")
def shipped(friction: QuarterCar, numbers: Values) -> AlphaMap:
    """The map of the shipped rig."""
    return alpha_map(friction, numbers)


def test_alpha_is_met_within_a_half_per_cent_of_its_magnitude(
    shipped: AlphaMap, friction: QuarterCar, numbers: Values
) -> None:
    angles = jnp.linspace(*RANGE, 400)
    exact = np.asarray(equivalents(friction, numbers, jnp.zeros(400), angles).alpha)
    found = np.asarray([float(shipped.alpha(angle)) for angle in angles])
    left = (found - exact) / np.max(np.abs(exact))
    assert np.sqrt(np.mean(left**2)) < 0.002
    assert np.max(np.abs(left)) < 0.005


@given(angle=st.floats(*RANGE))
def test_the_position_is_the_integral_of_alpha(shipped: AlphaMap, angle: float) -> None:
    nominal = float(shipped.nominal)
    area, _ = quad(lambda at: float(shipped.alpha(jnp.asarray(at))), nominal, angle, epsabs=1e-14)
    assert float(shipped.position(jnp.asarray(angle))) == pytest.approx(area, abs=1e-13)


def test_the_position_is_zero_at_the_nominal_angle_and_falls_with_the_angle(
    shipped: AlphaMap, numbers: Values
) -> None:
    assert float(shipped.position(numbers["psi_nominal"])) == 0.0
    angles = np.linspace(*RANGE, 100)
    assert np.all(np.diff([float(shipped.position(jnp.asarray(each))) for each in angles]) < 0.0)


@given(turn=st.floats(-0.1, 0.1))
def test_a_small_turn_moves_the_wheel_by_the_position_if_the_strut_is_rigid(
    shipped: AlphaMap, numbers: Values, turn: float
) -> None:
    """To first order exactly, to second as the linkage bends: within 3 % of the way at 0.1 rad."""
    nominal = float(numbers["psi_nominal"])
    wishbone = wishbone_at_length(numbers, length(numbers, 0.0, nominal), nominal + turn)
    moved = float(shipped.position(jnp.asarray(nominal + turn)))
    assert moved == pytest.approx(travel(numbers, wishbone), rel=0.03, abs=1e-12)
