"""A harder damper: its whole table in proportion, both ways."""

import pytest

from savgs_ident.core.rig import Rig

from .laws import in_the_rig, instant


@pytest.mark.parametrize("velocity", [-2.0, -0.1, 0.3, 3.0])
def test_the_table_scales_as_one(rig: Rig, numbers: dict[str, float], velocity: float) -> None:
    change, at = 0.3, instant(thetad=velocity)
    p = numbers | {"damper_scale_change": change}
    changed, plain = (in_the_rig(rig, p, names, at)[1] for names in (("damper_scale",), ()))
    damping = float(plain.ports["strut"].load)
    assert damping * float(plain.strut_rate) < 0.0
    assert float(changed.strut) - float(plain.strut) == pytest.approx(change * damping, rel=1e-9)
