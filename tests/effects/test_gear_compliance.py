"""A torsion spring before the link."""

import jax.numpy as jnp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.rig import Rig
from savgs_ident.effects.gear_compliance import GearCompliance
from savgs_ident.model.kinematics import strut_length

from ..model.instants import as_values
from .laws import balance_of, in_the_rig, instant, typical

GEAR = GearCompliance()


@given(total=st.floats(-200.0, 200.0), rest=st.floats(-100.0, 0.0), compliance=st.floats(0.0, 1e-2))
def test_settled_it_is_wound_up_by_what_is_beyond_rest(total: float, rest: float, compliance: float) -> None:
    p = typical(GEAR, gear_compliance=compliance)
    way = compliance * (total - rest)
    assert abs(balance_of(GEAR, p, total, rest, way)) < 1e-12
    assert balance_of(GEAR, p, total, rest, way + 1e-3) == pytest.approx(1e-3, rel=1e-9)


def test_wound_up_the_link_stands_further_on_and_its_torque_is_the_strut_s(
    rig: Rig, numbers: dict[str, float]
) -> None:
    """At rest as drawn the torque is that of rest: there it is not wound up at all."""
    p, turned = as_values(numbers), 0.05
    at = instant()
    loads = in_the_rig(rig, numbers, ("gear_compliance",), at, (turned,))[1]
    length = strut_length(p, jnp.zeros(()), p["psi_nominal"] + turned)
    assert float(loads.ports["strut"].displacement) == pytest.approx(float(length), rel=1e-12)
    still, loads = in_the_rig(rig, numbers, ("gear_compliance",), at)
    assert abs(still[2]) < 1e-9
    assert float(loads.carried["link"].total) == pytest.approx(float(loads.carried["link"].rest), rel=1e-9)
