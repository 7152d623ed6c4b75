"""The linear equivalent: equations (4)-(8), the masses of a rig, the map of alpha."""

import control
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

from savgs_ident.control.linear_equivalent import (
    RANGE,
    AlphaMap,
    Equivalent,
    TwoMasses,
    alpha_map,
    equivalents,
    lumped_mass,
    nominal_equivalent,
    paper_masses,
    quarter_car_space,
    resting_angles,
    with_damper_at_rest,
    with_distributed_masses,
)
from savgs_ident.control.linear_study import SmallMotions
from savgs_ident.control.linearisation import resting
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import build_model, model_parameters
from savgs_ident.plants.quarter_car.dynamics import upright_mass
from savgs_ident.plants.quarter_car.kinematics import linkage, strut_length
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over
from .by_hand import length, slope, travel, wishbone_at_length, wishbone_at_travel

wishbones = st.floats(-0.15, 0.15)
links = st.floats(0.0, np.pi)


def _equivalent(model: QuarterCar, p: Values, wishbone: float, link: float) -> Equivalent:
    found = equivalents(model, p, jnp.asarray([wishbone]), jnp.asarray([link]))
    return Equivalent(*(float(part[0]) for part in found))


def _length_at_travel(p: Values, at: float, link: float) -> float:
    return length(p, wishbone_at_travel(p, at), link)


@given(wishbone=wishbones, link=links)
def test_alpha_is_how_far_the_wheel_rises_per_link_angle_at_constant_strut_length(
    frictionless: QuarterCar, numbers: Values, wishbone: float, link: float
) -> None:
    held = length(numbers, wishbone, link)

    def wheel(angle: float) -> float:
        return travel(numbers, wishbone_at_length(numbers, held, angle))

    found = _equivalent(frictionless, numbers, wishbone, link).alpha
    assert found == pytest.approx(slope(wheel, link, 2e-3), abs=1e-9)


@given(wishbone=wishbones, link=links)
def test_the_ratio_is_how_much_the_strut_shortens_per_wheel_travel(
    frictionless: QuarterCar, numbers: Values, wishbone: float, link: float
) -> None:
    by_hand = slope(lambda at: -_length_at_travel(numbers, at, link), travel(numbers, wishbone), 1e-3)
    found = _equivalent(frictionless, numbers, wishbone, link)
    assert found.ratio == pytest.approx(by_hand, rel=1e-8)


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
    assert lumped_mass(m_s, m_u).tolist() == [[m_s, 0.0], [0.0, m_u]]


@pytest.fixture(scope="module")
def distributed(small: SmallMotions) -> TwoMasses:
    """With wishbones and upright as the bodies they are."""
    return small.masses["(8), masses distributed, too"]


@pytest.mark.slow
def test_distributed_masses_weigh_in_heave_what_the_lumped_ones_do(
    distributed: TwoMasses, numbers: Values
) -> None:
    """Chassis and wheel at one velocity: nothing turns, everything moves."""
    total = float(numbers["m_s"]) + float(numbers["m_u"])
    assert distributed.mass.sum() == pytest.approx(total, rel=1e-12)


@pytest.mark.slow
def test_distributed_masses_are_positive_and_symmetric(distributed: TwoMasses) -> None:
    assert distributed.mass == pytest.approx(distributed.mass.T, rel=1e-12)
    assert np.min(np.linalg.eigvalsh(distributed.mass)) > 0.0


@pytest.mark.slow
def test_distributed_masses_hold_the_kinetic_energy_of_the_bodies(
    distributed: TwoMasses, numbers: Values
) -> None:
    """The chassis still and the wheel at 1 m/s: the bodies by differences of their places."""

    def place(name: str) -> np.ndarray:
        def along(part: int) -> float:
            def at(angle: float) -> float:
                return float(np.ravel(getattr(linkage(numbers, jnp.asarray(angle)), name))[part])

            return slope(at, 0.0, 1e-3)

        return np.array([along(part) for part in range(2 if name.startswith("cg") else 1)])

    per_angle = slope(lambda angle: travel(numbers, angle), 0.0, 1e-3)
    bodies = {"L": numbers["m_L"], "U": numbers["m_U"], "K": upright_mass(numbers)}
    twice = sum(
        float(mass) * np.sum(place(f"cg_{body}") ** 2)
        + float(numbers[f"J_{body}"]) * place(f"roll_{body}")[0] ** 2
        for body, mass in bodies.items()
    )
    assert distributed.mass[1, 1] == pytest.approx(twice / per_angle**2, rel=1e-8)


def test_the_damper_at_rest_has_the_slope_of_its_curve_there(
    frictionless: QuarterCar, numbers: Values, masses: TwoMasses
) -> None:
    at_rest = with_damper_at_rest(frictionless, numbers, masses)
    step = 1e-7
    share = float(frictionless.damper(jnp.asarray(step)) - frictionless.damper(jnp.asarray(-step))) / (
        2.0 * step
    )
    assert at_rest.c_eq == pytest.approx(share * masses.c_eq, rel=1e-4)
    assert at_rest._replace(c_eq=masses.c_eq) == masses


def test_friction_changes_none_of_the_numbers(
    friction: QuarterCar, frictionless: QuarterCar, numbers: Values
) -> None:
    with_it, without = paper_masses(friction, numbers), paper_masses(frictionless, numbers)
    assert with_it[1:] == without[1:]
    assert np.array_equal(with_it.mass, without.mass)


@pytest.mark.slow
def test_an_effect_that_changes_a_mass_is_in_the_numbers(rig: Rig) -> None:
    model = build_model(rig, ("sprung_mass", "unsprung_mass"))
    p = as_values(model_parameters(rig, ("sprung_mass", "unsprung_mass")).as_dict())
    effective = model.effective(p)
    found = paper_masses(model, p)
    heavy = with_distributed_masses(model, p, found)
    assert np.diag(found.mass) == pytest.approx([float(effective["m_s"]), float(effective["m_u"])])
    assert np.trace(found.mass) != pytest.approx(float(p["m_s"]) + float(p["m_u"]), rel=1e-6)
    assert heavy.mass.sum() == pytest.approx(found.mass.sum(), rel=1e-12)


@pytest.fixture(scope="module")
def shipped(friction: QuarterCar, numbers: Values) -> AlphaMap:
    """The map of the shipped rig."""
    return alpha_map(friction, numbers)


@pytest.mark.slow
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


LINKS = np.radians([0.0, 40.0, 90.0, 140.0, 180.0])


def _energy(p: Values, q: Array, link: Array) -> Array:
    """Potential energy [J] at (z_s, theta_LW), road at zero, from the places of the bodies alone."""
    pose = linkage(p, q[1])
    heights = {"L": p["m_L"], "U": p["m_U"], "K": upright_mass(p)}
    weight = p["m_s"] * q[0] + sum(
        mass * (q[0] + getattr(pose, f"cg_{body}")[1]) for body, mass in heights.items()
    )
    squeeze = p["l_free"] - strut_length(p, q[1], link)
    pressed = jnp.maximum(p["r_free"] - (q[0] + pose.W[1]) / jnp.cos(pose.roll_K + p["tilt"]), 0.0)
    return p["g"] * weight + p["k_sd"] * squeeze**2 / 2.0 + p["k_t"] * pressed**2 / 2.0


_force = jax.jit(jax.grad(_energy, argnums=1))
_stiffness = jax.jit(jax.hessian(_energy, argnums=1))


@pytest.mark.slow
@over("link", LINKS)
def test_the_energy_is_least_at_rest(frictionless: QuarterCar, numbers: Values, link: float) -> None:
    at = resting(frictionless, numbers, link)
    q = np.array([float(part) for part in at.q])
    stiffness = np.asarray(_stiffness(numbers, q, np.float64(link)))
    off = np.linalg.solve(stiffness, np.asarray(_force(numbers, q, np.float64(link))))
    assert np.max(np.abs(off)) < 1e-9
    assert np.min(np.linalg.eigvalsh(stiffness)) > 0.0
    road, turned = at.signals
    assert [float(part) for part in (*at.qd, *road, turned.rate)] == [0.0] * 5


@pytest.mark.slow
def test_both_ways_to_the_rest_agree_along_the_link_angle(frictionless: QuarterCar, numbers: Values) -> None:
    along = np.asarray(resting_angles(frictionless, numbers, jnp.asarray(LINKS))[0])
    single = [float(resting(frictionless, numbers, link).q.theta_LW) for link in LINKS]
    assert along == pytest.approx(single, abs=1e-12)


@pytest.mark.slow
def test_the_drawing_is_the_rest_at_the_nominal_link_angle(frictionless: QuarterCar, numbers: Values) -> None:
    at = np.asarray(resting_angles(frictionless, numbers, jnp.asarray(LINKS))[0])
    assert float(numbers["psi_nominal"]) == pytest.approx(LINKS[2])
    assert at[2] == pytest.approx(0.0, abs=1e-9)


def test_a_link_that_turns_upward_lifts_the_chassis_off_the_wheel(
    frictionless: QuarterCar, numbers: Values
) -> None:
    """It presses the strut: at the same load the strut's upper end, and the chassis, have to give way upward."""
    at = np.asarray(resting_angles(frictionless, numbers, jnp.asarray(LINKS))[0])
    assert np.all(np.diff(at) < 0.0)
