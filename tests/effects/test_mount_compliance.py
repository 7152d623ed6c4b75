"""A spring with a damper beside it: it creeps to its deflection with their time constant."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.effects.mount_compliance import MountCompliance

from .laws import balance_of, give_way, typical

MOUNT = MountCompliance()
LOAD = 1000.0


def test_under_a_step_it_creeps_to_its_deflection() -> None:
    """C F (1 - exp(-t / C c))."""
    compliance, damping, step = 2e-6, 5e3, 2e-5
    p = typical(MOUNT, mount_compliance=compliance, mount_damping=damping)
    way = give_way(MOUNT, p, np.full(5000, LOAD), step)[:, 0]
    seconds = step * np.arange(1, 5001)
    expected = compliance * LOAD * (1.0 - np.exp(-seconds / (compliance * damping)))
    assert np.max(np.abs(way - expected)) < 1e-3 * compliance * LOAD


@given(total=st.floats(-1e4, 1e4), rest=st.floats(-1e4, 1e4), compliance=st.floats(0.0, 2e-5))
def test_settled_it_gives_way_by_what_is_beyond_rest(total: float, rest: float, compliance: float) -> None:
    p = typical(MOUNT, mount_compliance=compliance)
    assert abs(balance_of(MOUNT, p, total, rest, compliance * (total - rest))) < 1e-15
    assert balance_of(MOUNT, p, total, rest, compliance * (total - rest) + 1e-6) == pytest.approx(
        1e-6, rel=1e-6
    )


def test_its_damper_stiffens_it_at_once_and_not_in_the_long_run() -> None:
    """Of a tenth of a second of load, more damping lets less through at first."""
    steps = np.full(200, LOAD)
    soft, stiff = (give_way(MOUNT, typical(MOUNT, mount_damping=c), steps, 1e-5)[:, 0] for c in (100.0, 5e3))
    assert np.all(stiff < soft)
    assert soft[-1] == pytest.approx(5e-7 * LOAD, rel=1e-6)
