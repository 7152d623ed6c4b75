"""Friction that rises towards rest."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.effects.rail_stribeck import RailStribeck

from .laws import signals, typical

STRIBECK = RailStribeck()
P = typical(STRIBECK, mu_r=0.03)
RISE, SPEED = float(P["stribeck_rise"]), float(P["stribeck_velocity"])


def _share(velocity: float, load: float = 5000.0) -> float:
    """What it adds, relative to the friction of fast sliding."""
    grip = STRIBECK.grip(P, signals(velocity=velocity, load=load))
    assert float(grip.against_up) == float(grip.against_down)
    return float(grip.against_up) / (0.03 * load)


def test_at_rest_it_is_the_rise_and_fast_it_is_gone() -> None:
    assert _share(0.0) == pytest.approx(RISE, rel=1e-12)
    assert _share(SPEED) == pytest.approx(RISE / math.e, rel=1e-12)
    assert _share(5.0 * SPEED) < 1e-10 * RISE


@given(slow=st.floats(0.0, 0.5), more=st.floats(1e-3, 0.5), load=st.floats(1.0, 1e5))
def test_it_falls_with_speed_either_way_whatever_the_load(slow: float, more: float, load: float) -> None:
    assert _share(slow + more, load) < _share(slow, load) or _share(slow, load) < 1e-12
    assert _share(-slow, load) == _share(slow, load)
    assert _share(slow, load) == pytest.approx(_share(slow), rel=1e-12, abs=1e-300)
