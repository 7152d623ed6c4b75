"""A tyre that damps more: only while it is being pressed or let go."""

import pytest

from savgs_ident.core.rig import Rig

from .laws import in_the_rig, instant


@pytest.mark.parametrize("velocity", [-0.3, 0.0, 0.2])
def test_the_load_grows_with_the_rate_of_compression(
    rig: Rig, numbers: dict[str, float], velocity: float
) -> None:
    at = instant(roadd=velocity)
    changed, plain = (in_the_rig(rig, numbers, names, at)[1] for names in (("tyre_damping",), ()))
    rate = float(plain.touch.compression_rate)
    assert (rate > 0.0) == (velocity > 0.0)
    more = numbers["tyre_damping_change"] * numbers["c_t"] * rate / float(plain.touch.cos_tilt)
    assert float(changed.vertical) - float(plain.vertical) == pytest.approx(more, rel=1e-9, abs=1e-9)
