"""A stiffer tyre about the same free radius."""

import pytest

from savgs_ident.core.rig import Rig

from .laws import in_the_rig, instant


@pytest.mark.parametrize("change", [-0.3, 0.1])
def test_the_load_grows_in_proportion_to_the_compression(
    rig: Rig, numbers: dict[str, float], change: float
) -> None:
    """By the same share at any compression, with the same compression at the same place; none in the air."""
    p = numbers | {"tyre_stiffness_change": change}
    for road in (0.0, 0.01):
        at = instant(road=road)
        changed, plain = (in_the_rig(rig, p, names, at)[1] for names in (("tyre_stiffness",), ()))
        assert float(plain.vertical) > 1000.0
        assert float(changed.vertical) == pytest.approx((1.0 + change) * float(plain.vertical), rel=1e-12)
        assert float(changed.touch.compression) == float(plain.touch.compression)
    assert float(in_the_rig(rig, p, ("tyre_stiffness",), instant(road=-0.02))[1].vertical) == 0.0
