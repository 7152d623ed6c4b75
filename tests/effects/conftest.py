"""Numbers of the rig with everything in the catalogue."""

import pytest

from savgs_ident.plants.quarter_car.rig import Rig

from ..plants.quarter_car.instants import all_parameters


@pytest.fixture(scope="session")
def numbers(rig: Rig) -> dict[str, float]:
    """All parameters of the rig and of the catalogue, SI."""
    return all_parameters(rig).as_dict()
