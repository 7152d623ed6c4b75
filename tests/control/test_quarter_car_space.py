"""Equation (8): against the two-mass equations written out, their energy, and limits that need no calculation."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from savgs_ident.control.quarter_car_space import TwoMasses, lumped, quarter_car_space

OPEN = 2j * np.pi


def _numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(np.log(low), np.log(high)).map(lambda log: float(np.exp(log)))


@st.composite
def rigs(draw: st.DrawFn) -> TwoMasses:
    """Any two masses, coupled as little or as much as a positive definite matrix allows."""
    m_s, m_u = draw(_numbers(50.0, 1000.0)), draw(_numbers(10.0, 100.0))
    coupled = draw(st.floats(-0.9, 0.9)) * np.sqrt(m_s * m_u)
    mass = np.array([[m_s, coupled], [coupled, m_u]])
    return TwoMasses(
        mass, draw(_numbers(1e4, 1e5)), draw(_numbers(1e2, 1e4)), draw(_numbers(1e5, 1e6)),
        draw(_numbers(10.0, 1e3)),
    )  # fmt: skip


def _analytic(rig: TwoMasses, s: complex) -> NDArray[np.complex128]:
    """Outputs (4, 2) per height of the road and per z_lin, from the forces on two masses at heights z_s, z_u."""
    strut, tyre = rig.k_eq + rig.c_eq * s, rig.k_t + rig.c_t * s
    dynamic = s**2 * rig.mass + np.array([[strut, -strut], [-strut, strut + tyre]])
    z = np.linalg.solve(dynamic, np.array([[0.0, -strut], [tyre, strut]]))
    road, lin = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    return np.stack([s**2 * z[0], z[1] - z[0], road - z[1], lin])


@given(rig=rigs(), frequency=_numbers(0.01, 100.0))
def test_the_response_is_that_of_two_masses(rig: TwoMasses, frequency: float) -> None:
    s = OPEN * frequency
    found, wanted = quarter_car_space(rig)(s) * s, _analytic(rig, s)
    assert np.abs(found - wanted).max(axis=1) == pytest.approx(0.0, abs=1e-9 * np.abs(wanted).max())


@given(rig=rigs())
def test_stored_energy_changes_by_what_dampers_take_and_ends_bring(rig: TwoMasses) -> None:
    """For all states and inputs at once: the power balance as matrices."""
    space = quarter_car_space(rig)
    stored = np.zeros((5, 5))
    stored[:2, :2] = rig.mass
    stretch = np.array([0.0, 0.0, 1.0, 0.0, -1.0])
    stored += rig.k_eq * np.outer(stretch, stretch)
    stored[3, 3] += rig.k_t
    gain = np.vstack([stored @ space.A, np.zeros((2, 5))])
    gain = np.hstack([gain, np.vstack([stored @ space.B, np.zeros((2, 2))])])
    # By states and inputs: rates of the strut and of the tyre, and the forces that they exert.
    strut_rate = np.array([-1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0])
    tyre_rate = np.array([0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    strut_force = rig.k_eq * np.append(stretch, [0.0, 0.0]) + rig.c_eq * strut_rate
    tyre_force = rig.k_t * np.eye(7)[3] + rig.c_t * tyre_rate
    power = np.outer(np.eye(7)[5], tyre_force) - np.outer(np.eye(7)[6], strut_force)
    power -= rig.c_eq * np.outer(strut_rate, strut_rate) + rig.c_t * np.outer(tyre_rate, tyre_rate)
    left = (gain + gain.T) - (power + power.T)
    assert np.abs(left).max() == pytest.approx(0.0, abs=1e-9 * np.abs(power).max())


@given(rig=rigs())
def test_it_is_stable_but_for_the_position_that_only_its_input_moves(rig: TwoMasses) -> None:
    poles = np.sort_complex(quarter_car_space(rig).poles())
    assert np.all(poles[:-1].real < 0.0)
    assert poles[-1] == pytest.approx(0.0, abs=1e-9)


@given(rig=rigs())
def test_a_slow_link_moves_the_wheel_by_z_lin_and_a_slow_road_moves_nothing(rig: TwoMasses) -> None:
    s = OPEN * 1e-5
    per_metre = quarter_car_space(rig)(s) * s
    assert per_metre[1, 1] == pytest.approx(1.0, abs=1e-5)
    assert per_metre[3, 1] == pytest.approx(1.0, abs=1e-12)
    assert abs(per_metre[2, 1]) < 1e-5
    assert np.abs(per_metre[:, 0]).max() < 1e-5


def test_a_fast_road_only_squeezes_the_tyre(masses: TwoMasses) -> None:
    s = OPEN * 1e5
    fast = quarter_car_space(masses)(s) * s
    assert fast[2, 0] == pytest.approx(1.0, rel=1e-4)
    # What the damper passes on of a fast z_lin accelerates the sprung mass.
    assert fast[0, 1] / s == pytest.approx(-masses.c_eq / masses.mass[0, 0], rel=1e-3)
    assert abs(fast[1, 0]) < 1e-4


def test_a_free_motion_is_that_of_the_equations_integrated(masses: TwoMasses) -> None:
    start = np.array([0.3, -1.0, 0.01, -0.004, 0.002])
    times = np.linspace(0.0, 1.0, 201)
    (m_s, _), (_, m_u) = masses.mass

    def rates(t: float, x: NDArray[np.float64]) -> list[float]:
        v_s, v_u, l_s, l_t, lin = x
        force = masses.k_eq * (l_s - lin) + masses.c_eq * (v_u - v_s)
        return [force / m_s, (masses.k_t * l_t - masses.c_t * v_u - force) / m_u, v_u - v_s, -v_u, 0.0]

    wanted = solve_ivp(rates, (0.0, 1.0), start, "DOP853", times, rtol=1e-11, atol=1e-13).y
    found = control.initial_response(quarter_car_space(masses), times, start).states
    assert found == pytest.approx(wanted, abs=1e-8)


@given(m_s=_numbers(50.0, 1000.0), m_u=_numbers(10.0, 100.0))
def test_lumped_masses_move_apart(m_s: float, m_u: float) -> None:
    assert lumped(m_s, m_u).tolist() == [[m_s, 0.0], [0.0, m_u]]
