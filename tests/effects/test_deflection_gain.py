"""A gain error shows at every frequency alike, and on the deflection alone."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import build_model

from ..model.instants import as_values


@pytest.mark.parametrize("error", [-0.3, 0.05])
def test_it_multiplies_the_deflection_alone(rig: Rig, numbers: dict[str, float], error: float) -> None:
    p = as_values(numbers | {"deflection_gain_error": error})
    accel, deflection = build_model(rig, ("deflection_gain",)).transfers(p, jnp.asarray([0.0, 0.5, 60.0]))
    np.testing.assert_allclose(deflection, 1.0 + error, rtol=1e-15)
    assert np.all(np.asarray(accel) == 1.0)
