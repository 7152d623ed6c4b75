"""Grease: a force against the velocity, in proportion to it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.effects.rail_viscous import RailViscous

from .laws import force_of, typical

VISCOUS = RailViscous()
P = typical(VISCOUS)
C = float(P["rail_viscous_damping"])


@given(velocity=st.floats(-2.0, 2.0), load=st.floats(0.0, 1e5), place=st.floats(-0.1, 0.1))
def test_it_opposes_the_velocity_in_proportion(velocity: float, load: float, place: float) -> None:
    """Whatever the rail carries, and wherever the body is."""
    assert force_of(VISCOUS, P, place, velocity, load) == pytest.approx(-C * velocity, rel=1e-14, abs=1e-290)


def test_it_takes_the_energy_of_a_dashpot() -> None:
    """pi c w A^2 in a cycle of amplitude A."""
    amplitude, omega = 0.01, 2.0 * np.pi * 2.35
    phase = 2.0 * np.pi * np.arange(64) / 64
    velocity = amplitude * omega * np.cos(phase)
    power = [force_of(VISCOUS, P, velocity=float(each)) * each for each in velocity]
    energy = -np.mean(power) * 2.0 * np.pi / omega
    assert energy == pytest.approx(np.pi * C * omega * amplitude**2, rel=1e-12)
