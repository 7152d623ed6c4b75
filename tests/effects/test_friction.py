"""Frictions: of the rail, the joints, the strut and the tyre."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from savgs_ident.core.values import Values
from savgs_ident.effects.base import Port, PortKind, PortSignals, Presliding, bristle
from savgs_ident.effects.effect import generic_effects
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.kinematics import strut_length
from savgs_ident.plants.quarter_car.rig import Rig

from ..plants.quarter_car.instants import as_values
from .laws import follow, in_the_rig, instant, signals, typical

# rail_coulomb: eqs. (1)-(2): what the rail holds is in proportion to what it carries.

RAIL = CATALOGUE["rail_coulomb"]


@given(mu=st.floats(0.0, 0.5), load=st.floats(0.0, 1e5), velocity=st.floats(-2.0, 2.0))
def test_it_holds_its_share_of_the_load_both_ways(mu: float, load: float, velocity: float) -> None:
    limit = RAIL.friction_limit(typical(RAIL, mu_r=mu), signals(velocity=velocity, load=load))
    assert float(limit.against_up) == float(limit.against_down)
    assert float(limit.against_up) == pytest.approx(mu * load, rel=1e-15, abs=1e-290)


@pytest.mark.parametrize("theta", [-0.1, 0.1])
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_a_body_that_slides_is_held_by_that_and_one_that_sticks_by_the_bristle(
    rig: Rig, numbers: dict[str, float], theta: float, way: float
) -> None:
    sliding = instant(zd=0.3 * way, theta=theta, road=0.37 * theta)
    loads = in_the_rig(rig, numbers, ("rail_coulomb",), sliding, (-1e-3 * way,))[1]
    assert float(loads.rail) == pytest.approx(-way * numbers["mu_r"] * float(loads.carriage), rel=1e-12)
    sticking = instant(theta=theta, road=0.37 * theta)
    stretch = 0.5 * numbers["mu_r"] * float(loads.carriage) / numbers["k_pre"] * way
    held = in_the_rig(rig, numbers, ("rail_coulomb",), sticking, (-stretch,))[1]
    assert float(held.rail) == pytest.approx(-numbers["k_pre"] * stretch, rel=1e-12)


def test_its_null_has_the_slope_of_the_friction_to_either_side() -> None:
    """Right at mu_r = 0 the derivative is the load opposing the motion, up and down alike."""
    load = 5000.0

    def force(mu: Array, velocity: float) -> Array:
        seen = signals(velocity=velocity, load=load)
        p = {"mu_r": mu}
        return bristle(
            Presliding(jnp.asarray(1e7), jnp.asarray(3e4)), seen, RAIL.friction_limit(p, seen), mu * 0.0
        ).force

    slope = jax.grad(force)
    assert [float(slope(jnp.zeros(()), velocity)) for velocity in (0.3, -0.3)] == [-load, load]


# rail_preload: preload: the rail holds the same whatever it carries.

PRELOAD = CATALOGUE["rail_preload"]


@given(
    load=st.floats(0.0, 1e5),
    velocity=st.floats(-2.0, 2.0),
    force=st.floats(0.0, 3000.0, allow_subnormal=False),
)
def test_it_holds_the_same_both_ways_at_any_load(load: float, velocity: float, force: float) -> None:
    limit = PRELOAD.friction_limit(
        typical(PRELOAD, rail_preload_force=force), signals(velocity=velocity, load=load)
    )
    assert (float(limit.against_up), float(limit.against_down)) == (force, force)


@pytest.mark.parametrize("theta", [-0.1, 0.1])
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_a_body_that_slides_feels_it_alone(
    rig: Rig, numbers: dict[str, float], theta: float, way: float
) -> None:
    """The carriages carry more the more the suspension is bent; the friction is the same."""
    at = instant(z=0.0, zd=0.3 * way, roadd=0.3 * way, theta=theta, road=0.37 * theta)
    loads = in_the_rig(rig, numbers, ("rail_preload",), at, (-1e-3 * way,))[1]
    assert float(loads.rail) == pytest.approx(-way * numbers["rail_preload_force"], rel=1e-12)
    assert not jnp.isclose(loads.carriage, 0.0)


# rail_stribeck: friction that rises towards rest.

STRIBECK = CATALOGUE["rail_stribeck"]
STRIBECK_P = typical(STRIBECK, mu_r=0.03)
STRIBECK_RISE, STRIBECK_SPEED = float(STRIBECK_P["stribeck_rise"]), float(STRIBECK_P["stribeck_velocity"])


def _share(velocity: float, load: float = 5000.0) -> float:
    """What it adds, relative to the friction of fast sliding."""
    limit = STRIBECK.friction_limit(STRIBECK_P, signals(velocity=velocity, load=load))
    assert float(limit.against_up) == float(limit.against_down)
    return float(limit.against_up) / (0.03 * load)


def test_at_rest_it_is_the_rise_and_fast_it_is_gone() -> None:
    assert _share(0.0) == pytest.approx(STRIBECK_RISE, rel=1e-12)
    assert _share(STRIBECK_SPEED) == pytest.approx(STRIBECK_RISE / math.e, rel=1e-12)
    assert _share(5.0 * STRIBECK_SPEED) < 1e-10 * STRIBECK_RISE


@given(slow=st.floats(0.0, 0.5), more=st.floats(1e-3, 0.5), load=st.floats(1.0, 1e5))
def test_it_falls_with_speed_either_way_whatever_the_load(slow: float, more: float, load: float) -> None:
    assert _share(slow + more, load) < _share(slow, load) or _share(slow, load) < 1e-12
    assert _share(-slow, load) == _share(slow, load)
    assert _share(slow, load) == pytest.approx(_share(slow), rel=1e-12, abs=1e-300)


# bush_breakaway: friction without load that rises towards rest.


@given(
    force=st.floats(0.1, 1e3),
    rise=st.floats(0.02, 10.0),
    speed=st.floats(1e-3, 1.0),
    velocity=st.floats(-2.0, 2.0),
)
def test_without_load_it_is_the_friction_of_fast_sliding_and_what_stribecks_law_adds_to_as_much(
    force: float, rise: float, speed: float, velocity: float
) -> None:
    port = Port("bush", PortKind.FORCE, "bush", contact=("k", "c"))
    (effect,) = (each for each in generic_effects((port,)).values() if each.law.name == "breakaway")
    numbers = {"bush_breakaway_force": force, "bush_breakaway_rise": rise, "bush_breakaway_velocity": speed}
    found = effect.friction_limit(as_values(numbers), signals(velocity=velocity))
    added = STRIBECK.friction_limit(
        as_values({"mu_r": 0.03, "stribeck_rise": rise, "stribeck_velocity": speed}),
        signals(velocity=velocity, load=force / 0.03),
    )
    assert float(found.against_up) == float(found.against_down)
    assert float(found.against_up) == pytest.approx(force + float(added.against_up), rel=1e-12)


# rail_asymmetry: a rail that holds more one way: the mean of both stays, the two differ.

ASYMMETRY = CATALOGUE["rail_asymmetry"]


@given(load=st.floats(0.0, 1e5), share=st.floats(-0.95, 0.95))
def test_what_it_adds_up_it_takes_down(load: float, share: float) -> None:
    limit = ASYMMETRY.friction_limit(typical(ASYMMETRY, mu_r=0.03, rail_asymmetry=share), signals(load=load))
    assert float(limit.against_up) == -float(limit.against_down)
    assert float(limit.against_up) == pytest.approx(share * 0.03 * load, rel=1e-12, abs=1e-290)


@pytest.mark.parametrize("share", [-0.5, 0.2])
def test_a_sliding_body_is_held_by_one_more_and_one_less(
    rig: Rig, numbers: dict[str, float], share: float
) -> None:
    """At the same load; the rig moves with the road as one, so that nothing else depends on the velocity."""
    held = {}
    for way in (1.0, -1.0):
        at = instant(zd=0.3 * way, roadd=0.3 * way, road=0.005)
        p = numbers | {"rail_asymmetry": share}
        loads = in_the_rig(rig, p, ("rail_coulomb", "rail_asymmetry"), at, (-1e-3 * way,))[1]
        held[way] = -way * float(loads.rail) / float(loads.carriage)
    assert held[1.0] == pytest.approx(numbers["mu_r"] * (1.0 + share), rel=1e-12)
    assert held[-1.0] == pytest.approx(numbers["mu_r"] * (1.0 - share), rel=1e-12)


# joint_friction: joints that stick before they slide, with a force of their own.

JOINTS = CATALOGUE["joint_friction"]
STRETCH = 1e-4
"""How far joints and seals give before they slide [m]."""

JOINTS_P = typical(JOINTS)
JOINTS_FORCE = float(JOINTS_P["joint_friction_force"])
JOINTS_STEP = 2e-4


def test_a_slow_pull_sticks_over_its_stretch_then_slides() -> None:
    pulled = 4e-4 * JOINTS_STEP * np.arange(5000)
    force = -follow(JOINTS, JOINTS_P, pulled, JOINTS_STEP, 0.0)
    sticking = (pulled > 0.1 * STRETCH) & (pulled < 0.8 * STRETCH)
    assert np.polyfit(pulled[sticking], force[sticking], 1)[0] == pytest.approx(
        JOINTS_FORCE / STRETCH, rel=0.01
    )
    assert force[pulled > 1.1 * STRETCH] == pytest.approx(JOINTS_FORCE, rel=1e-12)


@pytest.mark.parametrize("force", [20.0, 400.0])
def test_a_cycle_costs_the_work_of_sliding(force: float) -> None:
    """4 F (A - x_0) for an amplitude A, whatever the rate."""
    amplitude, period = 2e-3, 5.0
    phase = 2.0 * np.pi * np.arange(round(2.0 * period / JOINTS_STEP)) * JOINTS_STEP / period
    moved = amplitude * np.sin(phase)
    along = follow(JOINTS, typical(JOINTS, joint_friction_force=force), moved, JOINTS_STEP, 0.0)
    last = phase >= 2.0 * np.pi
    work = -np.sum(along[last] * np.gradient(moved)[last])
    assert work == pytest.approx(4.0 * force * (amplitude - STRETCH), rel=0.01)


def test_motions_within_its_stretch_do_not_slide() -> None:
    """The suspension is stiffer there and springs back."""
    moved = 0.3 * STRETCH * np.sin(2.0 * np.pi * 1.0 * JOINTS_STEP * np.arange(5000))
    force = follow(JOINTS, JOINTS_P, moved, JOINTS_STEP, 0.0)
    assert np.max(np.abs(force + JOINTS_FORCE / STRETCH * moved)) < 0.03 * JOINTS_FORCE


# strut_friction: seals that stick before they slide; their anchor counts from the drawing.

SEALS = CATALOGUE["strut_friction"]
SEALS_STEP = 2e-4


@pytest.fixture(scope="module")
def p(numbers: dict[str, float]) -> Values:
    return as_values(numbers)


@pytest.fixture(scope="module")
def drawn(p: Values) -> float:
    """The strut's length in the drawing's nominal state [m]."""
    return float(strut_length(p, jnp.zeros(()), p["psi_nominal"]))


def test_as_drawn_it_neither_pushes_nor_moves_its_anchor(p: Values, drawn: float) -> None:
    """So that periodic motions and standstills begin near the anchor's own zero."""
    seen = signals(displacement=drawn, rest=drawn)
    assert abs(float(SEALS.force(p, seen, jnp.zeros(1)))) < 1e-9
    assert abs(float(SEALS.rate(p, seen, jnp.zeros(1))[0])) < 1e-12


def test_pushed_and_pulled_it_slides_at_its_force(p: Values, drawn: float) -> None:
    force = float(p["strut_friction_force"])
    moved = 5e-3 * np.sin(2.0 * np.pi * 0.2 * SEALS_STEP * np.arange(50_000))
    along = follow(SEALS, p, drawn + moved, SEALS_STEP, 0.0, drawn)
    velocity = np.gradient(moved, SEALS_STEP)
    turning = np.sqrt(1.0 - 0.9**2)
    sliding = np.abs(velocity) > turning * np.max(np.abs(velocity))
    past = np.arange(moved.size) > 1000
    assert along[sliding & past] == pytest.approx(-force * np.sign(velocity[sliding & past]), rel=1e-9)
    last = slice(25_000, None)
    work = -np.sum(along[last] * np.gradient(moved)[last])
    assert work == pytest.approx(4.0 * force * (5e-3 - STRETCH), rel=0.01)


# tyre_friction: eq. (3): odd, growing with the scrub velocity, saturating, in proportion to the load.

TYRE_MU, TYRE_SHAPING = 0.25, 0.05

TYRE_TINY = 1e-290
"""Forces [N] below which XLA may take a product for zero."""

_force = jax.jit(lambda p, signals: CATALOGUE["tyre_friction"].force(p, signals, jnp.zeros(0)))


def _friction(velocity: float, load: float, mu: float = TYRE_MU, shaping: float = TYRE_SHAPING) -> float:
    values = {"mu_t": np.float64(mu), "ydot_Hth": np.float64(shaping)}
    return float(
        _force(values, PortSignals(np.float64(0.65), np.float64(velocity), np.float64(load), np.float64(0.0)))
    )


velocities = st.floats(-2.0, 2.0)
loads = st.floats(0.0, 2e4)


@given(velocity=velocities, load=loads)
def test_it_is_the_equation_of_the_paper(velocity: float, load: float) -> None:
    expected = -np.sign(velocity) * min(1.0, abs(velocity) / TYRE_SHAPING) * TYRE_MU * load
    assert _friction(velocity, load) == pytest.approx(expected, rel=1e-14, abs=TYRE_TINY)


@given(velocity=velocities, load=loads)
def test_it_is_odd_and_opposes_the_scrub(velocity: float, load: float) -> None:
    assert _friction(velocity, load) == -_friction(-velocity, load)
    assert _friction(velocity, load) * velocity <= 0.0


@given(velocity=st.floats(TYRE_SHAPING, 5.0), load=loads)
def test_it_saturates_at_the_friction_coefficient(velocity: float, load: float) -> None:
    assert _friction(velocity, load) == pytest.approx(-TYRE_MU * load, rel=1e-15, abs=TYRE_TINY)


@given(velocity=velocities, load=loads, factor=st.floats(0.0, 5.0))
def test_it_is_proportional_to_the_load_and_gone_with_it(velocity: float, load: float, factor: float) -> None:
    expected = factor * _friction(velocity, load)
    assert _friction(velocity, factor * load) == pytest.approx(expected, rel=1e-12, abs=TYRE_TINY)
    assert _friction(velocity, 0.0) == 0.0


@given(velocity=st.floats(-0.5 * TYRE_SHAPING, 0.5 * TYRE_SHAPING), load=loads, factor=st.floats(0.6, 4.0))
def test_below_saturation_only_the_ratio_counts(velocity: float, load: float, factor: float) -> None:
    scaled = _friction(velocity, load, TYRE_MU * factor, TYRE_SHAPING * factor)
    assert scaled == pytest.approx(_friction(velocity, load), rel=1e-12, abs=TYRE_TINY)
