"""Springs, stops and dampers at a force port."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.kinematics import strut_length, suspension_travel
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig

from ..plants.quarter_car.instants import as_values
from .laws import force_of, in_the_rig, instant, typical

# rail_viscous: grease: a force against the velocity, in proportion to it.

VISCOUS = CATALOGUE["rail_viscous"]
VISCOUS_P = typical(VISCOUS)
VISCOUS_C = float(VISCOUS_P["rail_viscous_damping"])


@given(velocity=st.floats(-2.0, 2.0), load=st.floats(0.0, 1e5), place=st.floats(-0.1, 0.1))
def test_it_opposes_the_velocity_in_proportion(velocity: float, load: float, place: float) -> None:
    """Whatever the rail carries, and wherever the body is."""
    assert force_of(VISCOUS, VISCOUS_P, place, velocity, load) == pytest.approx(
        -VISCOUS_C * velocity, rel=1e-14, abs=1e-290
    )


def test_it_takes_the_energy_of_a_dashpot() -> None:
    """pi c w A^2 in a cycle of amplitude A."""
    amplitude, omega = 0.01, 2.0 * np.pi * 2.35
    phase = 2.0 * np.pi * np.arange(64) / 64
    velocity = amplitude * omega * np.cos(phase)
    power = [force_of(VISCOUS, VISCOUS_P, velocity=float(each)) * each for each in velocity]
    energy = -np.mean(power) * 2.0 * np.pi / omega
    assert energy == pytest.approx(np.pi * VISCOUS_C * omega * amplitude**2, rel=1e-12)


# bushing_stiffness: a spring along the suspension's travel, unstrained as drawn.


@jax.jit
@jax.grad
def _slope_of_energy(angle: Array, p: Values) -> Array:
    """Slope of the energy in the wishbone's angle [N m]."""
    return 0.5 * p["bushing_stiffness"] * suspension_travel(p, angle) ** 2


@pytest.mark.parametrize("theta", [-0.12, 0.0, 0.08])
def test_the_wishbone_feels_the_slope_of_its_energy(
    rig: Rig, numbers: dict[str, float], theta: float
) -> None:
    """d/dtheta of k l_s^2 / 2, and nothing on the body: the spring is between the two."""
    at = instant(theta=theta, thetad=0.4)
    with_it, _ = in_the_rig(rig, numbers, ("bushing_stiffness",), at)
    without, _ = in_the_rig(rig, numbers, (), at)
    assert with_it[0] == without[0]
    expected = -float(_slope_of_energy(jnp.asarray(theta), as_values(numbers)))
    assert with_it[1] - without[1] == pytest.approx(expected, rel=1e-9, abs=1e-9)


# tyre_stiffening: a tyre whose stiffness grows with its compression.

TYRE = CATALOGUE["tyre_stiffening"]
TYRE_K = 275e3
TYRE_RISE = next(each for each in TYRE.parameters if each.name == "tyre_stiffening")


@given(compression=st.floats(1e-3, 0.03), rise=st.floats(TYRE_RISE.lower, TYRE_RISE.upper))
def test_secant_and_tangent_rise_once_and_twice(compression: float, rise: float) -> None:
    """k (1 + s c) and k (1 + 2 s c); within the bounds the tangent stays positive down to 3 cm."""
    p = typical(TYRE, k_t=TYRE_K, tyre_stiffening=rise)

    def total(c: float) -> float:
        return TYRE_K * c + force_of(TYRE, p, displacement=c)

    assert total(compression) / compression == pytest.approx(TYRE_K * (1.0 + rise * compression), rel=1e-9)
    step = 1e-5
    tangent = (total(compression + step) - total(compression - step)) / (2.0 * step)
    assert tangent == pytest.approx(TYRE_K * (1.0 + 2.0 * rise * compression), rel=1e-6, abs=1.0)
    assert tangent > 0.0


def test_a_tyre_in_the_air_does_not_push(rig: Rig, numbers: dict[str, float]) -> None:
    at = instant(road=-0.02)
    loads = in_the_rig(rig, numbers, ("tyre_stiffening",), at)[1]
    assert float(loads.touch.compression) < 0.0
    assert float(loads.vertical) == 0.0


# bump_stop: a stop that pushes once the strut is shorter than drawn by its gap, and never pulls.

STOP = CATALOGUE["bump_stop"]
STOP_P = typical(STOP, **read_rig(default_rig_path()).parameters.as_dict())
STOP_DRAWN = float(strut_length(STOP_P, jnp.zeros(()), STOP_P["psi_nominal"]))
STOP_GAP, STIFFNESS = float(STOP_P["bump_stop_gap"]), float(STOP_P["bump_stop_stiffness"])


@given(longer=st.floats(-STOP_GAP, 0.2), velocity=st.floats(-2.0, 2.0))
def test_there_is_nothing_before_the_gap_is_closed(longer: float, velocity: float) -> None:
    assert force_of(STOP, STOP_P, STOP_DRAWN + longer + 1e-12, velocity, rest=STOP_DRAWN) == 0.0


@given(pressed=st.floats(1e-6, 0.1))
def test_beyond_it_is_a_spring_that_pushes_apart(pressed: float) -> None:
    push = force_of(STOP, STOP_P, STOP_DRAWN - STOP_GAP - pressed, rest=STOP_DRAWN)
    assert push == pytest.approx(STIFFNESS * pressed, rel=1e-6)


def test_a_wider_gap_closes_later() -> None:
    wide = STOP_P | {"bump_stop_gap": STOP_P["bump_stop_gap"] * 2.0}
    place = STOP_DRAWN - 1.5 * STOP_GAP
    assert force_of(STOP, wide, place, rest=STOP_DRAWN) == 0.0
    assert force_of(STOP, STOP_P, place, rest=STOP_DRAWN) == pytest.approx(
        0.5 * STOP_GAP * STIFFNESS, rel=1e-9
    )


# damper_rebound_fade: a damper that pulls less: extension alone.

FADE = CATALOGUE["damper_rebound_fade"]


@given(push=st.floats(0.0, 1e4), fade=st.floats(-1.0, 0.95))
def test_a_damper_that_pushes_is_whole(push: float, fade: float) -> None:
    p = typical(FADE, damper_rebound_fade=fade)
    assert force_of(FADE, p, velocity=-0.2, load=push) == 0.0
    assert force_of(FADE, p, velocity=0.2, load=-push) == pytest.approx(fade * push, rel=1e-12, abs=1e-290)


@pytest.mark.parametrize("velocity", [-1.5, 1.5])
def test_in_the_rig_the_strut_is_damped_less_when_it_grows(
    rig: Rig, numbers: dict[str, float], velocity: float
) -> None:
    at = instant(thetad=velocity)
    faded, plain = (in_the_rig(rig, numbers, names, at)[1] for names in (("damper_rebound_fade",), ()))
    elastic = float(plain.strut) - float(plain.ports["strut"].load)
    left = (float(faded.strut) - elastic) / (float(plain.strut) - elastic)
    grows = float(plain.strut_rate) > 0.0
    assert left == pytest.approx(1.0 - numbers["damper_rebound_fade"] if grows else 1.0, rel=1e-9)


def test_one_of_the_two_velocities_is_extension(rig: Rig, numbers: dict[str, float]) -> None:
    """So that the test above has seen both."""
    ways = [float(in_the_rig(rig, numbers, (), instant(thetad=each))[1].strut_rate) for each in (-1.5, 1.5)]
    assert ways[0] * ways[1] < 0.0
