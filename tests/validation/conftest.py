"""Numbers of the rig, its catalogue and the foreign effects."""

import pytest

from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.validation.foreign_laws import FOREIGN

from ..plants.quarter_car.instants import all_parameters


@pytest.fixture(scope="session")
def numbers(rig: Rig) -> dict[str, float]:
    """All parameters, SI."""
    foreign = {p.name: p.value for each in FOREIGN.values() for p in each.effect.parameters}
    return all_parameters(rig).as_dict() | foreign
