"""Effects with states of their own along a road: what they are said to do there, against models that have them."""

import numpy as np
import pytest

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.diagnosis.dwell_problem import DwellProblem, dwell_problem
from savgs_ident.effects.effect import generic_effects
from savgs_ident.inference.background.port_functions import mesh_points, resonance
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.simulate.compared_tests import response_of_tests
from savgs_ident.simulate.periodic import PeriodicSolution
from tests.simulate.linear_roads import dwells_and_road

EFFECTS = {
    "mount_compliance": {"mount_compliance_compliance": 1e-9},
    "mount_resonance": {"mount_resonance_mobility": 1e-5, "mount_resonance_frequency": 11.81670775625111},
    "suspension_friction": {"suspension_friction_force": 3.0},
}
"""Small ones: by their parameters [SI]."""

Case = tuple[DwellProblem, PeriodicSolution]


@pytest.fixture(scope="module")
def case() -> Case:
    measured = response_of_tests(dwells_and_road(), TwoMass, 9)
    known = generic_effects(TwoMass.ports)
    catalogue = {name: known[name] for name in EFFECTS}
    problem, _ = dwell_problem(measured, TwoMass(), PARAMETERS, catalogue, free=("k", "c"))
    return problem, problem.start(PARAMETERS.as_dict())


@pytest.mark.slow
@pytest.mark.parametrize("name", list(EFFECTS))
def test_a_small_effect_does_along_a_road_what_it_is_said_to_do(case: Case, name: str) -> None:
    problem, start = case
    given = EFFECTS[name]
    (term,) = [each for each in problem.candidates if each.name == name]
    (columns,) = problem.sensitivities((), PARAMETERS.as_dict(), start, [term])
    (amplitude,) = term.amplitudes
    tried = [all(given.get(key, value) == value for key, value in each.items()) for each in term.tried].index(
        True
    )
    said = given[amplitude.name] * columns[tried][:, 0]
    values = PARAMETERS.as_dict() | given
    without, having = (problem.predict(terms, values, (), start) for terms in ((), (name,)))
    assert without.status.ok
    assert having.status.ok
    rows = np.isin(problem.likelihood.test, problem.excitation.windows)
    weight = 1.0 / problem.likelihood.data.discrepancy_scale[rows]
    done = (having.rows - without.rows)[rows] * weight
    miss = np.linalg.norm(said[rows] * weight - done) / np.linalg.norm(done)
    assert miss < 0.1


@pytest.mark.slow
def test_waves_of_a_cam_are_there_in_dwells_and_not_on_a_road() -> None:
    measured = response_of_tests(dwells_and_road(), TwoMass, 9)
    waves = generic_effects(TwoMass.ports)["road_harmonics"]
    given = {**PARAMETERS.as_dict(), **ParameterTable(waves.parameters).as_dict()}
    problem, _ = dwell_problem(measured, TwoMass(), PARAMETERS, {waves.name: waves}, free=("k", "c"))
    start = problem.start(PARAMETERS.as_dict())
    without, having = (problem.predict((), each, (), start) for each in (PARAMETERS.as_dict(), given))
    on_the_road = np.isin(problem.likelihood.test, problem.excitation.windows)
    change = (having.rows - without.rows) / problem.likelihood.data.discrepancy_scale
    assert np.linalg.norm(change[~on_the_road]) > 0.1
    assert np.abs(change[on_the_road]).max() < 1e-6


@pytest.mark.slow
def test_a_resonance_far_above_the_window_is_that_of_its_equation(case: Case) -> None:
    _, start = case
    nodes = mesh_points(start)
    window = int(start.excitation.windows[0])
    here = nodes.dwell == window
    period, natural, damping = 1.0 / float(start.excitation.frequency[window]), 21.0, 0.1
    order = round(20.0 * period)
    turns = order * nodes.phase[here]
    load = np.zeros(nodes.phase.size)
    load[here] = np.cos(turns)
    omega, own = 2.0 * np.pi * order / period, 2.0 * np.pi * natural
    exact = own**2 / (own**2 - omega**2 + 2j * damping * own * omega) * np.exp(1j * turns)
    found = resonance(load, natural, damping, nodes)[here]
    size = found @ exact.real / (exact.real @ exact.real)
    np.testing.assert_allclose(found, size * exact.real, atol=0.05 * np.abs(size * exact).max())
    assert size > 0.0
