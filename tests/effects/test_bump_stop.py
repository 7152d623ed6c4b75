"""A stop that pushes once the strut is shorter than drawn by its gap, and never pulls."""

import jax.numpy as jnp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.rig import default_rig_path, read_rig
from savgs_ident.effects.bump_stop import BumpStop
from savgs_ident.model.kinematics import strut_length

from .laws import force_of, typical

STOP = BumpStop()
P = typical(STOP, **read_rig(default_rig_path()).parameters.as_dict())
DRAWN = float(strut_length(P, jnp.zeros(()), P["psi_nominal"]))
GAP, STIFFNESS = float(P["bump_stop_gap"]), float(P["bump_stop_stiffness"])


@given(longer=st.floats(-GAP, 0.2), velocity=st.floats(-2.0, 2.0))
def test_there_is_nothing_before_the_gap_is_closed(longer: float, velocity: float) -> None:
    assert force_of(STOP, P, DRAWN + longer + 1e-12, velocity) == 0.0


@given(pressed=st.floats(1e-6, 0.1))
def test_beyond_it_is_a_spring_that_pushes_apart(pressed: float) -> None:
    push = force_of(STOP, P, DRAWN - GAP - pressed)
    assert push == pytest.approx(STIFFNESS * pressed, rel=1e-6)


def test_a_wider_gap_closes_later() -> None:
    wide = P | {"bump_stop_gap": P["bump_stop_gap"] * 2.0}
    place = DRAWN - 1.5 * GAP
    assert force_of(STOP, wide, place) == 0.0
    assert force_of(STOP, P, place) == pytest.approx(0.5 * GAP * STIFFNESS, rel=1e-9)
