"""A damper that pulls less: extension alone."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.rig import Rig
from savgs_ident.effects.damper_rebound_fade import DamperReboundFade

from .laws import force_of, in_the_rig, instant, typical

FADE = DamperReboundFade()


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
