"""A force learned where the catalogue has no name: on recordings of a rail whose friction falls with velocity."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from savgs_ident.core.values import as_values
from savgs_ident.diagnosis.dwell_problem import ITERATIONS, DwellProblem
from savgs_ident.diagnosis.held_out import hold_out
from savgs_ident.diagnosis.learning import LearnedLaw, learn
from savgs_ident.effects.base import Family, Port
from savgs_ident.effects.learned import learned_effect
from savgs_ident.effects.learned_functions import coefficients_at
from savgs_ident.inference.background.imposed import rows_of
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, search_of
from savgs_ident.inference.observations import Data
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model
from savgs_ident.plants.quarter_car.ports import DAMPER, RAIL
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import resolve

from .conftest import COARSE, Measure, rig_problem

BASELINE = MODELS["simtr"]


@pytest.fixture(scope="module")
def case(measure_few: Measure, rig: Rig) -> tuple[DwellProblem, Data, LaplaceFit]:
    """SimTR, recalibrated on a few dwells of a rail that it does not have."""
    catalogue = {name: CATALOGUE[name] for name in BASELINE}
    plant, data = rig_problem(measure_few("stribeck_rail"), rig, catalogue, COARSE.periodic)
    return plant, data, find_map(search_of(plant, data), (), {}, plant.start({}))


@pytest.fixture(scope="module")
def law(case: tuple[DwellProblem, Data, LaplaceFit]) -> LearnedLaw:
    """The force at the rail."""
    (found,) = learn(*case, [RAIL])
    return found


@pytest.mark.slow
def test_it_explains_tests_that_it_was_not_learned_from(
    case: tuple[DwellProblem, Data, LaplaceFit], law: LearnedLaw
) -> None:
    plant, data, base = case
    assert law.mode.status.ok
    without = hold_out(search_of(plant, data), base, ())
    held = law.held_out()
    missed = [np.sum((data.measured - each.rows) ** 2 / data.variance) for each in (without, held)]
    assert missed[1] < 0.1 * missed[0]
    assert held.mean > without.mean
    assert law.family is Family.FRICTION


@pytest.mark.slow
def test_as_an_effect_of_the_model_it_does_what_the_fit_says(law: LearnedLaw, rig: Rig) -> None:
    """The numbers alone, put into a model as an export does, give the response of the fit on the same nodes."""
    model = build_model(rig, (*BASELINE, law.name))
    p = as_values(law.problem.table.as_dict() | law.values)
    solution = resolve(model, p, law.mode.prediction.warm_start, ITERATIONS)
    assert all(status.ok for status in solution.status())
    rows = np.asarray(rows_of(model, law.problem.likelihood, p, solution, law.problem.orders))
    fitted = law.mode.prediction.rows
    assert np.linalg.norm(rows - fitted) < 1e-6 * np.linalg.norm(fitted)


@pytest.mark.slow
def test_it_knows_the_range_of_the_motion(law: LearnedLaw) -> None:
    assert set(law.spans) == {f"learned_rail_{name}" for name in ("middle", "stroke", "speed", "carried")}
    assert 0.005 < law.spans["learned_rail_stroke"] < 0.05
    assert 0.05 < law.spans["learned_rail_speed"] < 1.0


@pytest.mark.parametrize("port", [RAIL, DAMPER], ids=lambda port: port.name)
def test_its_values_are_all_that_it_needs_whichever_of_them_were_fitted(port: Port) -> None:
    effect = learned_effect(port)
    coefficient = coefficients_at(port)[0]
    problem: Any = SimpleNamespace(catalogue={effect.name: effect})
    mode: Any = SimpleNamespace(values={coefficient: 2e-4, "mu_r": 0.03})
    unused: Any = None
    law = LearnedLaw(effect.name, port, unused, problem, unused, mode, {}, {}, 0.0, None)
    assert set(law.values) == {"mu_r", *(each.name for each in effect.parameters)}
    assert law.values[coefficient] == 2e-4
    assert all(law.values[name] == 0.0 for name in set(effect.null) - {coefficient})
