"""A rail that holds more one way: the mean of both stays, the two differ."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.rig import Rig
from savgs_ident.effects.rail_asymmetry import RailAsymmetry

from .laws import in_the_rig, instant, signals, typical

ASYMMETRY = RailAsymmetry()


@given(load=st.floats(0.0, 1e5), share=st.floats(-0.95, 0.95))
def test_what_it_adds_up_it_takes_down(load: float, share: float) -> None:
    grip = ASYMMETRY.grip(typical(ASYMMETRY, mu_r=0.03, rail_asymmetry=share), signals(load=load))
    assert float(grip.against_up) == -float(grip.against_down)
    assert float(grip.against_up) == pytest.approx(share * 0.03 * load, rel=1e-12, abs=1e-290)


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
