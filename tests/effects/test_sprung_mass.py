"""A payload: its inertia and its weight on the body, nothing else."""

import pytest

from savgs_ident.core.rig import Rig

from ..model.instants import draw_instants
from .laws import in_the_rig


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("change", [-60.0, 15.0])
def test_it_adds_its_inertia_and_its_weight_to_the_body(
    rig: Rig, numbers: dict[str, float], seed: int, change: float
) -> None:
    at = draw_instants(seed, 1)[0]
    loaded, loads = in_the_rig(rig, numbers | {"sprung_mass_change": change}, ("sprung_mass",), at)
    plain, before = in_the_rig(rig, numbers, (), at)
    assert loaded[0] - plain[0] == pytest.approx(-change * (at[4] + numbers["g"]), rel=1e-9)
    assert loaded[1] == plain[1]
    assert float(loads.carriage) == float(before.carriage)
