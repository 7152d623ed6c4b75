"""A spring at a damper's end makes it a Maxwell element: it lags, and stiffens at high frequency."""

import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.damper_hysteresis import DamperHysteresis

from .laws import fundamental, give_way, in_the_rig, instant, typical

SPRING = DamperHysteresis()
DAMPING = 5792.0
NODES = 4000


@pytest.mark.parametrize("frequency", [1.0, 4.0, 20.0])
def test_with_a_linear_damper_it_is_a_maxwell_element(frequency: float) -> None:
    """Force over velocity is c / (1 + i w C c)."""
    compliance = 4e-6
    omega = 2.0 * np.pi * frequency
    phase = 2.0 * np.pi * np.arange(6 * NODES) / NODES
    closing = 0.2 * np.cos(phase)
    p = typical(SPRING, damper_compliance=compliance)
    way = give_way(
        SPRING, p, closing, 1.0 / frequency / NODES, lambda velocity, rate: DAMPING * (velocity - rate)
    )[:, 0]
    found = fundamental(way[-NODES:]) / compliance / fundamental(closing[-NODES:])
    expected = DAMPING / (1.0 + 1j * omega * compliance * DAMPING)
    assert abs(found - expected) < 3e-3 * abs(expected)


def test_it_is_the_damper_that_bends_it_not_the_strut_s_spring(rig: Rig, numbers: dict[str, float]) -> None:
    """By C times the damper's push, whatever the whole strut pushes."""
    at = instant(thetad=0.5)
    push = float(in_the_rig(rig, numbers, (), at)[1].ports["strut"].load)
    assert abs(push) > 50.0
    way = numbers["damper_compliance"] * push
    residual, loads = in_the_rig(rig, numbers, ("damper_hysteresis",), at, (way,))
    assert abs(residual[2]) < 1e-9 * abs(way)
    assert abs(float(loads.strut)) > 10.0 * abs(push)
