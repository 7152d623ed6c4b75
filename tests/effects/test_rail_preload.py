"""Preload: the rail holds the same whatever it carries."""

import jax.numpy as jnp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.rig import Rig
from savgs_ident.effects.rail_preload import RailPreload

from .laws import in_the_rig, instant, signals, typical

PRELOAD = RailPreload()


@given(
    load=st.floats(0.0, 1e5),
    velocity=st.floats(-2.0, 2.0),
    force=st.floats(0.0, 3000.0, allow_subnormal=False),
)
def test_it_holds_the_same_both_ways_at_any_load(load: float, velocity: float, force: float) -> None:
    grip = PRELOAD.grip(typical(PRELOAD, rail_preload_force=force), signals(velocity=velocity, load=load))
    assert (float(grip.against_up), float(grip.against_down)) == (force, force)


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
