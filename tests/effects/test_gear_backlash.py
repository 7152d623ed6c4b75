"""Two flanks: a torque that keeps its sign stays on one, one that changes it crosses the play."""

import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.gear_backlash import GearBacklash

from .laws import balance_of, give_way, in_the_rig, instant, typical

GEAR = GearBacklash()
P = typical(GEAR)
PLAY = float(P["gear_backlash"])


@pytest.mark.parametrize(("torque", "way"), [(-40.0, 0.0), (-5.0, 0.0), (0.0, 0.5), (5.0, 1.0), (40.0, 1.0)])
def test_it_lies_against_the_flank_that_the_torque_says(torque: float, way: float) -> None:
    """Counted from the one that carries at rest."""
    assert abs(balance_of(GEAR, P, torque, -57.0, way * PLAY)) < 1e-4 * PLAY


def test_a_torque_that_swings_through_zero_crosses_all_of_it() -> None:
    torque = 30.0 * np.cos(2.0 * np.pi * np.arange(4000) / 1000)
    way = give_way(GEAR, P, torque, 5e-4)[1000:, 0]
    assert np.ptp(way) == pytest.approx(PLAY, rel=1e-6)
    between = np.abs(way) < 0.45 * PLAY
    assert np.mean(between) < 0.05


def test_at_the_nominal_angle_the_strut_keeps_it_on_its_flank(rig: Rig, numbers: dict[str, float]) -> None:
    """Through 20 mm of strut either way."""
    for theta in (-0.07, 0.0, 0.07):
        residual, loads = in_the_rig(rig, numbers, ("gear_backlash",), instant(theta=theta))
        assert abs(float(loads.carried["link"].total)) > 10.0
        assert abs(residual[2]) < 1e-6 * PLAY
