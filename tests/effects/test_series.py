"""What gives way in the path of a load: mount, plate, gear, damper, carcass and frame."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from savgs_ident.effects.base import Load, PortSignals
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.kinematics import strut_length
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over
from ..plants.quarter_car.instants import as_values
from .laws import balance_of, fundamental, give_way, in_the_rig, instant, typical

# mount_compliance: a spring with a damper beside it: it creeps to its deflection with their time constant.

MOUNT = CATALOGUE["mount_compliance"]
MOUNT_LOAD = 1000.0


def test_under_a_step_it_creeps_to_its_deflection() -> None:
    """C F (1 - exp(-t / C c))."""
    compliance, damping, step = 2e-6, 5e3, 2e-5
    p = typical(MOUNT, mount_compliance=compliance, mount_damping=damping)
    way = give_way(MOUNT, p, np.full(5000, MOUNT_LOAD), step)[:, 0]
    seconds = step * np.arange(1, 5001)
    expected = compliance * MOUNT_LOAD * (1.0 - np.exp(-seconds / (compliance * damping)))
    assert np.max(np.abs(way - expected)) < 1e-3 * compliance * MOUNT_LOAD


@given(total=st.floats(-1e4, 1e4), rest=st.floats(-1e4, 1e4), compliance=st.floats(0.0, 2e-5))
def test_settled_it_gives_way_by_what_is_beyond_rest(total: float, rest: float, compliance: float) -> None:
    p = typical(MOUNT, mount_compliance=compliance)
    assert abs(balance_of(MOUNT, p, total, rest, compliance * (total - rest))) < 1e-15
    assert balance_of(MOUNT, p, total, rest, compliance * (total - rest) + 1e-6) == pytest.approx(
        1e-6, rel=1e-6
    )


def test_its_damper_stiffens_it_at_once_and_not_in_the_long_run() -> None:
    """Of a tenth of a second of load, more damping lets less through at first."""
    steps = np.full(200, MOUNT_LOAD)
    soft, stiff = (give_way(MOUNT, typical(MOUNT, mount_damping=c), steps, 1e-5)[:, 0] for c in (100.0, 5e3))
    assert np.all(stiff < soft)
    assert soft[-1] == pytest.approx(5e-7 * MOUNT_LOAD, rel=1e-6)


# plate_compliance: a plate that is lower than its encoder says, by what the tyre presses beyond the rig's weight.

PLATE = CATALOGUE["plate_compliance"]


@given(total=st.floats(0.0, 1e4), rest=st.floats(0.0, 5e3), compliance=st.floats(0.0, 1e-5))
def test_settled_it_is_lower_by_what_is_beyond_rest(total: float, rest: float, compliance: float) -> None:
    p = typical(PLATE, plate_compliance=compliance)
    assert abs(balance_of(PLATE, p, total, rest, compliance * (total - rest))) < 1e-15


def test_it_gives_back_what_it_took() -> None:
    """A spring, without a loop: the work of a cycle is nothing beside what it stores."""
    nodes, compliance, step = 4000, 1e-6, 1.0 / 2.35 / 4000
    load = 2000.0 * np.cos(2.0 * np.pi * np.arange(2 * nodes) / nodes)
    way = give_way(PLATE, typical(PLATE, plate_compliance=compliance), load, step)[nodes:, 0]
    work = np.sum(load[nodes:] * np.gradient(way))
    assert abs(work) < 5e-3 * compliance * 2000.0**2 / 2.0


def test_a_lower_plate_is_a_lower_road(rig: Rig, numbers: dict[str, float]) -> None:
    way = 1e-3
    found = in_the_rig(rig, numbers, ("plate_compliance",), instant(road=0.005), (way,))[0]
    expected = in_the_rig(rig, numbers, (), instant(road=0.005 - way))[0]
    assert found[:2] == pytest.approx(expected, rel=1e-11)


# gear_compliance: a torsion spring before the link.

GEAR_GEAR = CATALOGUE["gear_compliance"]


@given(total=st.floats(-200.0, 200.0), rest=st.floats(-100.0, 0.0), compliance=st.floats(0.0, 1e-2))
def test_settled_it_is_wound_up_by_what_is_beyond_rest(total: float, rest: float, compliance: float) -> None:
    p = typical(GEAR_GEAR, gear_compliance=compliance)
    way = compliance * (total - rest)
    assert abs(balance_of(GEAR_GEAR, p, total, rest, way)) < 1e-12
    assert balance_of(GEAR_GEAR, p, total, rest, way + 1e-3) == pytest.approx(1e-3, rel=1e-9)


def test_wound_up_the_link_stands_further_on_and_its_torque_is_the_strut_s(
    rig: Rig, numbers: dict[str, float]
) -> None:
    """At rest as drawn the torque is that of rest: there it is not wound up at all."""
    p, turned = as_values(numbers), 0.05
    at = instant()
    loads = in_the_rig(rig, numbers, ("gear_compliance",), at, (turned,))[1]
    length = strut_length(p, jnp.zeros(()), p["psi_nominal"] + turned)
    assert float(loads.ports["strut"].displacement) == pytest.approx(float(length), rel=1e-12)
    still, loads = in_the_rig(rig, numbers, ("gear_compliance",), at)
    assert abs(still[2]) < 1e-9
    assert float(loads.carried["link"].total) == pytest.approx(float(loads.carried["link"].rest), rel=1e-9)


# gear_backlash: two flanks: a torque that keeps its sign stays on one, one that changes it crosses the play.

BACKLASH_GEAR = CATALOGUE["gear_backlash"]
BACKLASH_P = typical(BACKLASH_GEAR)
BACKLASH_PLAY = float(BACKLASH_P["gear_backlash"])


@over(("torque", "way"), [(-40.0, 0.0), (-5.0, 0.0), (0.0, 0.5), (5.0, 1.0), (40.0, 1.0)])
def test_it_lies_against_the_flank_that_the_torque_says(torque: float, way: float) -> None:
    """Counted from the one that carries at rest."""
    assert (
        abs(balance_of(BACKLASH_GEAR, BACKLASH_P, torque, -57.0, way * BACKLASH_PLAY)) < 1e-4 * BACKLASH_PLAY
    )


def test_a_torque_that_swings_through_zero_crosses_all_of_it() -> None:
    torque = 30.0 * np.cos(2.0 * np.pi * np.arange(4000) / 1000)
    way = give_way(BACKLASH_GEAR, BACKLASH_P, torque, 5e-4)[1000:, 0]
    assert np.ptp(way) == pytest.approx(BACKLASH_PLAY, rel=1e-6)
    between = np.abs(way) < 0.45 * BACKLASH_PLAY
    assert np.mean(between) < 0.05


def test_at_the_nominal_angle_the_strut_keeps_it_on_its_flank(rig: Rig, numbers: dict[str, float]) -> None:
    """Through 20 mm of strut either way."""
    for theta in (-0.07, 0.0, 0.07):
        residual, loads = in_the_rig(rig, numbers, ("gear_backlash",), instant(theta=theta))
        assert abs(float(loads.carried["link"].total)) > 10.0
        assert abs(residual[2]) < 1e-6 * BACKLASH_PLAY


# damper_hysteresis: a spring at a damper's end makes it a Maxwell element: it lags, and stiffens at high frequency.

SPRING = CATALOGUE["damper_hysteresis"]
DAMPING = 5792.0
MAXWELL_NODES = 4000


@pytest.mark.parametrize("frequency", [1.0, 4.0, 20.0])
def test_with_a_linear_damper_it_is_a_maxwell_element(frequency: float) -> None:
    """Force over velocity is c / (1 + i w C c)."""
    compliance = 4e-6
    omega = 2.0 * np.pi * frequency
    phase = 2.0 * np.pi * np.arange(6 * MAXWELL_NODES) / MAXWELL_NODES
    closing = 0.2 * np.cos(phase)
    p = typical(SPRING, damper_compliance=compliance)
    way = give_way(
        SPRING,
        p,
        closing,
        1.0 / frequency / MAXWELL_NODES,
        lambda velocity, rate: DAMPING * (velocity - rate),
    )[:, 0]
    found = fundamental(way[-MAXWELL_NODES:]) / compliance / fundamental(closing[-MAXWELL_NODES:])
    expected = DAMPING / (1.0 + 1j * omega * compliance * DAMPING)
    assert abs(found - expected) < 3e-3 * abs(expected)


def test_it_is_the_damper_that_bends_it_not_the_strut_s_spring(rig: Rig, numbers: dict[str, float]) -> None:
    """By C times the damper's push, whatever the whole strut pushes."""
    at = instant(thetad=0.5)
    push = float(in_the_rig(rig, numbers, (), at)[1].ports["strut"].load)
    assert abs(push) > 50.0
    way = numbers["damper_compliance"] * push
    residual, loads = in_the_rig(rig, numbers, ("damper_hysteresis",), at, (way,))
    assert abs(residual[2]) < 1e-9 * abs(way)
    assert abs(float(loads.strut)) > 10.0 * abs(push)


# tyre_lateral_compliance: a carcass between the wheel and the scrubbing tread.

CARCASS, TREAD = CATALOGUE["tyre_lateral_compliance"], CATALOGUE["tyre_friction"]
BELT_DAMPING, BELT_MASS = 1000.0, 5.0
PRESSED, CARCASS_NODES = 3600.0, 4000
CARCASS_P = typical(CARCASS) | typical(TREAD)
DRAG = float(CARCASS_P["mu_t"] / CARCASS_P["ydot_Hth"]) * PRESSED
"""What the tread's friction is below saturation: a dashpot [N s/m]."""


def _on_the_plate(scrub: Array, rate: Array) -> Array:
    """Force of the tread on the plate, outward; the carcass gives way under it."""
    zero = jnp.zeros(())
    return -TREAD.force(CARCASS_P, PortSignals(zero, scrub - rate, zero + PRESSED, zero), jnp.zeros(0))


def _scrubbed(amplitude: float, frequency: float, compliance: float) -> tuple[np.ndarray, np.ndarray]:
    """Scrub velocity of the wheel and deflection of the carcass in the last of six cycles."""
    velocity = amplitude * np.cos(2.0 * np.pi * np.arange(6 * CARCASS_NODES) / CARCASS_NODES)
    p = CARCASS_P | typical(CARCASS, tyre_lateral_compliance=compliance)
    way = give_way(CARCASS, p, velocity, 1.0 / frequency / CARCASS_NODES, _on_the_plate)[:, 0]
    return velocity[-CARCASS_NODES:], way[-CARCASS_NODES:]


@pytest.mark.parametrize("frequency", [1.0, 4.0])
@pytest.mark.parametrize("compliance", [2e-7, 2e-6, 1e-5])
def test_slow_scrub_is_a_spring_in_series_with_a_dashpot(frequency: float, compliance: float) -> None:
    """Deflection over velocity: D C / (1 + i w C (D + c) - w^2 C m), the mass hardly showing."""
    velocity, way = _scrubbed(0.02, frequency, compliance)
    found = fundamental(way) / fundamental(velocity)
    omega = 2.0 * np.pi * frequency
    stiffness = 1.0 / compliance + 1j * omega * (DRAG + BELT_DAMPING) - omega**2 * BELT_MASS
    expected = DRAG / stiffness
    assert abs(found - expected) < 5e-3 * abs(expected)


def test_fast_scrub_bends_it_by_what_the_friction_can_hold() -> None:
    """mu F_tz C, once the tread slides: where the scrub is fastest either way."""
    _, way = _scrubbed(0.5, 2.0, 2e-6)
    bent = float(CARCASS_P["mu_t"]) * PRESSED * 2e-6
    assert way[[0, CARCASS_NODES // 2]] == pytest.approx([bent, -bent], rel=1e-3)


# frame_mode: one mode: its poles, its static deflection, and that it carries rail and plate along.

FRAME = CATALOGUE["frame_mode"]


@pytest.mark.parametrize(("frequency", "ratio"), [(12.0, 0.05), (40.0, 0.3)])
def test_its_poles_and_its_static_deflection_are_those_of_a_mode(frequency: float, ratio: float) -> None:
    """-zeta w +- i w sqrt(1 - zeta^2) and beta F / w^2."""
    p = typical(FRAME, frame_frequency=frequency, frame_damping_ratio=ratio, frame_mobility=2e-3)
    none = jnp.zeros(2)

    def rates(state: jax.Array, force: jax.Array) -> jax.Array:
        return -FRAME.balance(p, Load(force - 3600.0, jnp.asarray(-3600.0)), state, none)

    matrix = np.asarray(jax.jacfwd(rates)(none, jnp.zeros(())))
    omega = 2.0 * np.pi * frequency
    poles = sorted(np.linalg.eigvals(matrix), key=lambda pole: pole.imag)
    turn = omega * np.sqrt(1.0 - ratio**2)
    assert poles == pytest.approx([-ratio * omega - 1j * turn, -ratio * omega + 1j * turn], rel=1e-9)
    bent = np.linalg.solve(matrix, -np.asarray(rates(none, jnp.asarray(500.0))))
    assert bent == pytest.approx([2e-3 * 500.0 / omega**2, 0.0], abs=1e-15)


def test_a_frame_that_is_higher_lifts_plate_and_rail(rig: Rig, numbers: dict[str, float]) -> None:
    """The tyre feels a higher road; the rail's carriages feel the body that much lower."""
    up = 2e-3
    effects = ("rail_coulomb", "frame_mode")
    residual, loads = in_the_rig(rig, numbers, effects, instant(), (0.0, up, 0.0))
    plain = in_the_rig(rig, numbers, ("rail_coulomb",), instant(road=up), (up,))[1]
    assert float(loads.vertical) == pytest.approx(float(plain.vertical), rel=1e-12)
    assert float(loads.ports["rail"].displacement) == -up
    assert float(loads.carried["frame"].total) == -float(loads.vertical) - float(loads.rail)
    assert np.isfinite(residual).all()
