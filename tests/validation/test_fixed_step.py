"""The integration of fixed step says how it ended."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.status import Status
from savgs_ident.core.values import as_values
from savgs_ident.plants.profiles import ProfileSource, Sine
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.simulate.transient import pack_state, rest_state
from savgs_ident.validation.virtual_motions import integrate_fixed


@pytest.mark.parametrize(
    ("duration", "step", "status"), [(1.0, 1e-3, Status.CONVERGED), (100.0, 1.0, Status.NOT_FINITE)]
)
def test_a_step_that_is_too_long_for_the_plant_is_reported(
    duration: float, step: float, status: Status
) -> None:
    """The unsprung mass oscillates at 12 Hz: with steps of 1 s the motion grows beyond all numbers."""
    plant, p = TwoMass(), as_values(PARAMETERS.as_dict())
    source = ProfileSource((Sine(0.01, 2.0, 0.0, 0.0, 0.5),))
    start = pack_state(rest_state(plant, p, source, jnp.zeros(())))
    _, readings, found = integrate_fixed(plant, p, start, source, duration, 10, step)
    assert found is status
    assert bool(np.isfinite(readings).all()) is status.ok
