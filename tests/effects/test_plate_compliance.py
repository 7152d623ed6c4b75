"""A plate that is lower than its encoder says, by what the tyre presses beyond the rig's weight."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.rig import Rig
from savgs_ident.effects.plate_compliance import PlateCompliance

from .laws import balance_of, give_way, in_the_rig, instant, typical

PLATE = PlateCompliance()


@given(total=st.floats(0.0, 1e4), rest=st.floats(0.0, 5e3), compliance=st.floats(0.0, 1e-5))
def test_settled_it_is_lower_by_what_is_beyond_rest(total: float, rest: float, compliance: float) -> None:
    p = typical(PLATE, plate_compliance=compliance)
    assert abs(balance_of(PLATE, p, total, rest, compliance * (total - rest))) < 1e-15


def test_it_gives_back_what_it_took() -> None:
    """A spring, without a loop: the work of a cycle is nothing beside what it stores."""
    nodes, compliance, step = 4000, 1e-6, 1.0 / 2.35 / 4000
    load = 2000.0 * np.cos(2.0 * np.pi * np.arange(2 * nodes) / nodes)
    way = give_way(PLATE, typical(PLATE, plate_compliance=compliance), load, step)[nodes:, 0]
    work = np.sum(load[nodes:] * np.gradient(way))
    assert abs(work) < 5e-3 * compliance * 2000.0**2 / 2.0


def test_a_lower_plate_is_a_lower_road(rig: Rig, numbers: dict[str, float]) -> None:
    way = 1e-3
    found = in_the_rig(rig, numbers, ("plate_compliance",), instant(road=0.005), (way,))[0]
    expected = in_the_rig(rig, numbers, (), instant(road=0.005 - way))[0]
    assert found[:2] == pytest.approx(expected, rel=1e-11)
