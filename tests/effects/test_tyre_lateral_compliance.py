"""A carcass between the wheel and the scrubbing tread."""

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.effects.tyre_friction import TyreFriction
from savgs_ident.effects.tyre_lateral_compliance import DAMPING, MASS, TyreLateralCompliance
from savgs_ident.model.effect import PortSignals

from .laws import fundamental, give_way, typical

CARCASS, TREAD = TyreLateralCompliance(), TyreFriction()
PRESSED, NODES = 3600.0, 4000
P = typical(CARCASS) | typical(TREAD)
DRAG = float(P["mu_t"] / P["ydot_Hth"]) * PRESSED
"""What the tread's friction is below saturation: a dashpot [N s/m]."""


def _on_the_plate(scrub: Array, rate: Array) -> Array:
    """Force of the tread on the plate, outward; the carcass gives way under it."""
    zero = jnp.zeros(())
    return -TREAD.force(P, PortSignals(zero, scrub - rate, zero + PRESSED), jnp.zeros(0))


def _scrubbed(amplitude: float, frequency: float, compliance: float) -> tuple[np.ndarray, np.ndarray]:
    """Scrub velocity of the wheel and deflection of the carcass in the last of six cycles."""
    velocity = amplitude * np.cos(2.0 * np.pi * np.arange(6 * NODES) / NODES)
    p = P | typical(CARCASS, tyre_lateral_compliance=compliance)
    way = give_way(CARCASS, p, velocity, 1.0 / frequency / NODES, _on_the_plate)[:, 0]
    return velocity[-NODES:], way[-NODES:]


@pytest.mark.parametrize("frequency", [1.0, 4.0])
@pytest.mark.parametrize("compliance", [2e-7, 2e-6, 1e-5])
def test_slow_scrub_is_a_spring_in_series_with_a_dashpot(frequency: float, compliance: float) -> None:
    """Deflection over velocity: D C / (1 + i w C (D + c) - w^2 C m), the mass hardly showing."""
    velocity, way = _scrubbed(0.02, frequency, compliance)
    found = fundamental(way) / fundamental(velocity)
    omega = 2.0 * np.pi * frequency
    stiffness = 1.0 / compliance + 1j * omega * (DRAG + DAMPING) - omega**2 * MASS
    expected = DRAG / stiffness
    assert abs(found - expected) < 5e-3 * abs(expected)


def test_fast_scrub_bends_it_by_what_the_friction_can_hold() -> None:
    """mu F_tz C, once the tread slides: where the scrub is fastest either way."""
    _, way = _scrubbed(0.5, 2.0, 2e-6)
    bent = float(P["mu_t"]) * PRESSED * 2e-6
    assert way[[0, NODES // 2]] == pytest.approx([bent, -bent], rel=1e-3)
