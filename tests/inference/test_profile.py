"""Profiles of a normal posterior are parabolas of the marginal standard deviation."""

import numpy as np
import pytest

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.inference.surrogate_shape import SPAN, STEPS, profile_of, surrogate_mode

from .toy import FIXED_SCALES, straight_toy
from .toy_surrogate import mode_of, normal_covariance, stand_for

pytestmark = pytest.mark.slow

FREE = FreeVector(
    ParameterTable(
        (
            Parameter("gain", 2.0, "1", tolerance=2.0),
            Parameter("offset", 1.0, "m", tolerance=1.0),
            Parameter("spring", 157e3, "N/m", tolerance=1.6e3),
        )
    ),
    ("gain", "offset"),
    ("spring",),
)
"""Identified ones without bounds: their values are linear in their coordinates."""

SCALE = {"gain": 2.0, "offset": 1.0, "spring": 1.6e3}


@pytest.mark.parametrize("name", FREE.names)
def test_the_rise_is_the_square_of_the_deviation(name: str) -> None:
    # Data so strong that all priors are flat.
    toy = straight_toy(FREE, FIXED_SCALES, strength=300.0)
    surrogate = stand_for(toy).surrogate
    line = profile_of(surrogate, name, surrogate_mode(surrogate))
    place = FREE.names.index(name)
    scale = SCALE[name]
    mode = FREE.parameters[place].value + scale * mode_of(toy)[place]
    sd = scale * np.sqrt(normal_covariance(toy)[place, place])
    deviation = (line.values - mode) / sd
    np.testing.assert_allclose(line.rise, deviation**2, atol=2e-3)
    assert line.values.size == 2 * STEPS + 1
    assert deviation[[0, -1]] == pytest.approx([-SPAN, SPAN], rel=1e-2)
