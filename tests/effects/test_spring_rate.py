"""A stiffer spring about the same free length."""

import pytest

from savgs_ident.core.rig import Rig

from .laws import in_the_rig, instant


@pytest.mark.parametrize("change", [-0.2, 0.05])
def test_the_push_grows_in_proportion_and_vanishes_at_the_same_length(
    rig: Rig, numbers: dict[str, float], change: float
) -> None:
    """With nothing else that pushes: at rest."""
    p = numbers | {"spring_rate_change": change}
    for theta in (-0.1, 0.1):
        at = instant(theta=theta)
        changed, plain = (in_the_rig(rig, p, names, at)[1] for names in (("spring_rate",), ()))
        length = float(plain.ports["strut"].displacement)
        assert float(plain.strut) == pytest.approx(p["k_sd"] * (p["l_free"] - length), rel=1e-12)
        assert float(changed.strut) == pytest.approx((1.0 + change) * float(plain.strut), rel=1e-12)
    free = numbers | {"l_free": length, "spring_rate_change": change}
    assert abs(float(in_the_rig(rig, free, ("spring_rate",), at)[1].strut)) < 1e-6
