"""An encoder that reads too little: the link stands where it would at a greater reading."""

import numpy as np
import pytest

from savgs_ident.core.rig import Rig

from .laws import in_the_rig, instant


@pytest.mark.parametrize("reading", [0.3, np.pi / 2.0, 2.5])
@pytest.mark.parametrize("offset", [-0.3, 0.2])
def test_it_is_the_rig_at_the_true_angle(
    rig: Rig, numbers: dict[str, float], reading: float, offset: float
) -> None:
    p = numbers | {"link_offset": offset}
    read = instant(theta=0.03, thetad=0.4, link=reading, linkd=2.0)
    true = instant(theta=0.03, thetad=0.4, link=reading + offset, linkd=2.0)
    found, expected = in_the_rig(rig, p, ("link_offset",), read)[0], in_the_rig(rig, p, (), true)[0]
    assert found == pytest.approx(expected, rel=1e-11)
    assert found != pytest.approx(in_the_rig(rig, p, (), read)[0], rel=1e-4)
