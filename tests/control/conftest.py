"""The rig's models, their linear studies and the shipped design, each made once; programs kept between runs."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import control
import pytest

from savgs_ident.control.closed_loop.run import Loop
from savgs_ident.control.closed_loop.study import loop_around
from savgs_ident.control.design import Design, DigitalController, design_controller, rigs_from_covariance
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS, generalised_plant
from savgs_ident.control.linear_equivalent import TwoMasses, alpha_map, paper_masses, quarter_car_space
from savgs_ident.control.linear_study import (
    CamMotions,
    SmallMotions,
    study_small_motions,
    study_test_motions,
)
from savgs_ident.control.synthesis import Synthesis, discretise, synthesise_hinf
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import NO_ORIGIN, no_progress
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig

from ..relaxed import with_kept_programs

FEW_RIGS = 3


@pytest.fixture(scope="package", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.fixture(scope="package")
def table(rig: Rig) -> ParameterTable:
    """All parameters of the rig with friction."""
    return model_parameters(rig, MODELS["simtr"])


@pytest.fixture(scope="package")
def numbers(table: ParameterTable) -> Values:
    """Their values, SI."""
    return as_values(table.as_dict())


@pytest.fixture(scope="package")
def friction(rig: Rig) -> QuarterCar:
    """SimTR."""
    return build_model(rig, MODELS["simtr"])


@pytest.fixture(scope="package")
def frictionless(rig: Rig) -> QuarterCar:
    """SimQC."""
    return build_model(rig, MODELS["simqc"])


@pytest.fixture(scope="package")
def masses(friction: QuarterCar, numbers: Values) -> TwoMasses:
    """The numbers of equation (8)."""
    return paper_masses(friction, numbers)


@pytest.fixture(scope="package")
def space(masses: TwoMasses) -> control.StateSpace:
    """Equation (8)."""
    return quarter_car_space(masses)


@pytest.fixture(scope="package")
def bandwidth(numbers: Values) -> float:
    """Of the actuator [Hz]."""
    return float(numbers["motor_reference_bandwidth"])


@pytest.fixture(scope="package")
def plant_with(space: control.StateSpace, bandwidth: float) -> Callable[..., control.StateSpace]:
    """The generalised plant with some weights changed, whatever their bounds say."""

    def plant(**changed: float) -> control.StateSpace:
        entries = DEFAULT_WEIGHTS.entries
        weights = tuple(replace(e, value=changed.get(e.name, e.value), lower=0.0) for e in entries)
        return generalised_plant(space, bandwidth, ParameterTable(weights))

    return plant


@pytest.fixture(scope="package")
def synthesis(plant_with: Callable[..., control.StateSpace]) -> Synthesis:
    """The H-infinity controller for the shipped rig and weights."""
    return synthesise_hinf(plant_with())


@pytest.fixture(scope="package")
def design(table: ParameterTable, rig: Rig) -> Design:
    """The whole design on the shipped rig."""
    rigs = rigs_from_covariance(table, rig.provenance, FEW_RIGS)
    model = RigModel(rig, MODELS["simtr"])
    return design_controller(model, rigs, DEFAULT_WEIGHTS, NO_ORIGIN, no_progress)


@pytest.fixture(scope="package")
def small(friction: QuarterCar, numbers: Values) -> SmallMotions:
    """The linear models and the nonlinear rig at small motions."""
    return study_small_motions(friction, numbers)


@pytest.fixture(scope="package")
def at_test(friction: QuarterCar, numbers: Values) -> CamMotions:
    """The rig with describing functions and the nonlinear one at the size of the test."""
    return study_test_motions(friction, numbers)


@pytest.fixture(scope="package")
def controller(synthesis: Synthesis, friction: QuarterCar, numbers: Values) -> DigitalController:
    """The same controller sampled, with the rig's alpha."""
    return DigitalController(discretise(synthesis.controller), alpha_map(friction, numbers))


@pytest.fixture(scope="package")
def loop(numbers: Values, controller: DigitalController) -> Loop:
    """That controller in a loop with the instruments of the sheet, without failures."""
    return loop_around(numbers, controller)
