"""The paper's models and their numbers."""

import pytest

from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig

from .instants import all_parameters


@pytest.fixture(scope="session")
def numbers(rig: Rig) -> dict[str, float]:
    """All parameters of the rig and of the catalogue, SI."""
    return all_parameters(rig).as_dict()


@pytest.fixture(scope="session")
def simqc(rig: Rig) -> QuarterCar:
    """The rig without friction."""
    return build_model(rig, MODELS["simqc"])


@pytest.fixture(scope="session")
def simtr(rig: Rig) -> QuarterCar:
    """The rig with the friction of rail and tyre."""
    return build_model(rig, MODELS["simtr"])
