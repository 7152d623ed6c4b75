"""The paper's models at their numbers, and compiled programs kept from one run of the tests to the next."""

from collections.abc import Iterator

import pytest

from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import PeriodicSolution, simulate_periodic

from ..relaxed import with_kept_programs
from .programme import FEW, PROGRAMME, cam


@pytest.fixture(scope="package", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.fixture(scope="package")
def numbers(rig: Rig) -> Values:
    """All parameters of the rig with friction, SI."""
    return as_values(model_parameters(rig, MODELS["simtr"]).as_dict())


@pytest.fixture(scope="package")
def friction(rig: Rig) -> QuarterCar:
    """SimTR."""
    return build_model(rig, MODELS["simtr"])


@pytest.fixture(scope="package")
def frictionless(rig: Rig) -> QuarterCar:
    """SimQC."""
    return build_model(rig, MODELS["simqc"])


@pytest.fixture(scope="package")
def programme(friction: QuarterCar, numbers: Values) -> PeriodicSolution:
    """SimTR in all dwells of the programme, from a cold start with default settings."""
    return simulate_periodic(friction, numbers, cam(PROGRAMME))


@pytest.fixture(scope="package")
def few(friction: QuarterCar, numbers: Values) -> PeriodicSolution:
    """SimTR in a few unlike dwells, from a cold start with default settings."""
    return simulate_periodic(friction, numbers, cam(FEW))
