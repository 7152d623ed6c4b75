"""A tyre whose stiffness grows with its compression."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.rig import Rig
from savgs_ident.effects.tyre_stiffening import TyreStiffening

from .laws import force_of, in_the_rig, instant, typical

TYRE = TyreStiffening()
K = 275e3
RISE = next(each for each in TYRE.parameters if each.name == "tyre_stiffening")


@given(compression=st.floats(1e-3, 0.03), rise=st.floats(RISE.lower, RISE.upper))
def test_secant_and_tangent_rise_once_and_twice(compression: float, rise: float) -> None:
    """k (1 + s c) and k (1 + 2 s c); within the bounds the tangent stays positive down to 3 cm."""
    p = typical(TYRE, k_t=K, tyre_stiffening=rise)

    def total(c: float) -> float:
        return K * c + force_of(TYRE, p, displacement=c)

    assert total(compression) / compression == pytest.approx(K * (1.0 + rise * compression), rel=1e-9)
    step = 1e-5
    tangent = (total(compression + step) - total(compression - step)) / (2.0 * step)
    assert tangent == pytest.approx(K * (1.0 + 2.0 * rise * compression), rel=1e-6, abs=1.0)
    assert tangent > 0.0


def test_a_tyre_in_the_air_does_not_push(rig: Rig, numbers: dict[str, float]) -> None:
    at = instant(road=-0.02)
    loads = in_the_rig(rig, numbers, ("tyre_stiffening",), at)[1]
    assert float(loads.touch.compression) < 0.0
    assert float(loads.vertical) == 0.0
