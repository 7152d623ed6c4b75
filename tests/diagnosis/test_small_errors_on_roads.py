"""Errors of inputs and sensors along a road beside dwells, to first order: against recordings that have them."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.diagnosis.dwell_problem import DwellProblem, dwell_problem
from savgs_ident.inference.background.locations import _analysed, _readings, input_locations
from savgs_ident.inference.background.port_functions import InputLocation
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.simulate.compared_tests import response_of_tests
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import placed
from tests.simulate.linear_roads import dwells_and_road

pytestmark = pytest.mark.slow

Case = tuple[DwellProblem, PeriodicSolution, dict[str, InputLocation]]


@pytest.fixture(scope="module")
def case() -> Case:
    measured = response_of_tests(dwells_and_road(), TwoMass, 9)
    problem, _ = dwell_problem(measured, TwoMass(), PARAMETERS, {}, free=("k", "c"))
    start = problem.start(PARAMETERS.as_dict())
    about = problem._about(problem.model(()), PARAMETERS.as_dict(), start)
    return problem, start, {each.name: each for each in input_locations(about, problem.constants)}


def _driven_by(problem: DwellProblem, excitation: Excitation, start: PeriodicSolution) -> NDArray[np.float64]:
    """Rows on the nodes of a known motion, driven otherwise."""
    other = replace(problem, excitation=excitation)
    return other.predict((), PARAMETERS.as_dict(), (), replace(start, excitation=excitation)).rows


def _left(columns: NDArray[np.float64], done: NDArray[np.float64]) -> float:
    """Share of a change of the rows that a law does not make."""
    coefficients = np.linalg.lstsq(columns, done, rcond=None)[0]
    return float(np.linalg.norm(columns @ coefficients - done) / np.linalg.norm(done))


def test_a_road_of_another_size_or_time_is_an_error_of_the_input(case: Case) -> None:
    problem, start, locations = case
    given = _driven_by(problem, problem.excitation, start)
    rows = np.isin(problem.likelihood.test, problem.excitation.windows)
    order = np.arange(problem.excitation.harmonics["road_height"].shape[1])
    late = np.exp(-2j * np.pi * np.asarray(problem.excitation.frequency)[:, None] * order * 1e-4)
    for factor in (1.001, late):
        harmonics = {name: each * factor for name, each in problem.excitation.harmonics.items()}
        done = _driven_by(problem, problem.excitation._replace(harmonics=harmonics), start) - given
        weight = 1.0 / problem.likelihood.data.discrepancy_scale
        columns = locations["road"].functions * weight[:, None]
        assert _left(columns[rows], (done * weight)[rows]) < 0.01
        assert _left(columns, done * weight) < 0.01


def test_a_sensor_that_saturates_on_a_road_is_an_error_of_that_sensor(case: Case) -> None:
    """Its readings times one less a share of their square, in time, beside functions of them in time."""
    problem, start, locations = case
    layout = start.mesh.layout
    read = np.array(_readings(problem.model(()), placed(problem.values({})), start))
    read -= np.stack([read[layout.dwell == d].mean(axis=0) for d in range(len(layout.counts))])[layout.dwell]
    largest = np.abs(read[:, 0]).max()
    error = np.zeros_like(read)
    error[:, 0] = read[:, 0] ** 3 / largest**2
    done = np.asarray(problem.likelihood.rows(_analysed(jnp.asarray(error), start, problem.orders)))
    weight = 1.0 / problem.likelihood.data.discrepancy_scale
    rows = np.isin(problem.likelihood.test, problem.excitation.windows)
    columns = locations["sensor.body_accel"].functions * weight[:, None]
    assert np.linalg.norm((done * weight)[rows]) > 0.05 * np.linalg.norm(done * weight)
    assert _left(columns[rows], (done * weight)[rows]) < 0.05
    assert _left(columns, done * weight) < 0.05
