"""A drive holds its link against the strut as the rig really is, not as its drawing says."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.values import as_values
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.drive import holding_drive
from savgs_ident.plants.quarter_car.inputs import RigSource, flat_road
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.transient import rest_state, state_rates

pytestmark = pytest.mark.slow

NOMINAL = np.pi / 2.0


def test_a_link_mounted_off_by_an_angle_is_that_of_another_drawing(rig: Rig) -> None:
    road, drive, zero, moved = flat_road(), holding_drive(NOMINAL), jnp.zeros(()), 0.05
    offset = (*MODELS["simtr"], "link_offset")
    given = as_values(model_parameters(rig, offset).as_dict() | {"link_offset": moved})
    drawn = {**given, "theta_0": given["theta_0"] + moved}
    ways = ((build_model(rig, offset), given), (build_model(rig, MODELS["simtr"]), drawn))
    states, rates = [], []
    for model, p in ways:
        states.append(rest_state(model, p, RigSource(road, drive), zero))
        rates.append(state_rates(model, p, RigSource(road, drive), zero, states[-1]))
    assert np.max(np.abs(states[0].source)) > 0.01
    for one, other in (states, rates):
        assert np.asarray(one.source) == pytest.approx(np.asarray(other.source), rel=1e-9, abs=1e-9)
