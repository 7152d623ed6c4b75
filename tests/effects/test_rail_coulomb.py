"""Eqs. (1)-(2): what the rail holds is in proportion to what it carries."""

import jax
import jax.numpy as jnp
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from savgs_ident.core.rig import Rig
from savgs_ident.effects.rail_coulomb import RailCoulomb
from savgs_ident.model.bristle import Presliding, bristle

from .laws import in_the_rig, instant, signals, typical

RAIL = RailCoulomb()


@given(mu=st.floats(0.0, 0.5), load=st.floats(0.0, 1e5), velocity=st.floats(-2.0, 2.0))
def test_it_holds_its_share_of_the_load_both_ways(mu: float, load: float, velocity: float) -> None:
    grip = RAIL.grip(typical(RAIL, mu_r=mu), signals(velocity=velocity, load=load))
    assert float(grip.against_up) == float(grip.against_down)
    assert float(grip.against_up) == pytest.approx(mu * load, rel=1e-15, abs=1e-290)


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
            Presliding(jnp.asarray(1e7), jnp.asarray(3e4)), seen, RAIL.grip(p, seen), mu * 0.0
        ).force

    slope = jax.grad(force)
    assert [float(slope(jnp.zeros(()), velocity)) for velocity in (0.3, -0.3)] == [-load, load]
