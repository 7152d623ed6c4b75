"""Constants given to a diagnosis decide in all of it, whatever the plant."""

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident import diagnosis
from savgs_ident.diagnosis import diagnose as dwells
from savgs_ident.diagnosis import motion_problem as problems
from savgs_ident.diagnosis import public
from savgs_ident.diagnosis.motion_problem import motion_problem
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference import background
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.recorded_motion import driven_motion
from savgs_ident.simulate.along_motion import Needed, needed_forces

from ..in_one_test import over
from .recorded_axis import recorded_axis

OTHERS = replace(DEFAULTS, amplitude_width=3.0, simple_law_prior=0.3, alarm_log_odds=7.0)
PLANTS = ("quarter car", "two mass", "axis")


class _BegunError(Exception):
    """Raised in place of a diagnosis, with what that was asked for."""


def _two_mass() -> tuple[si.PlantModel, HarmonicResponse]:
    model = si.PlantModel(si.TwoMass(), si.TwoMass.parameters)
    response = si.simulate_dwells(
        model, (1.0, 2.0), {"road_height": 0.01}, {"body_accel": 0.05, "susp_deflection": 1e-4}
    )
    return model, response


@pytest.fixture
def cases(rig: Rig) -> dict[str, tuple[Any, Any]]:
    """Models and what was recorded of them, by plant."""
    two_mass = _two_mass()
    axis = si.PlantModel(si.Axis(), si.Axis.parameters), driven_motion(recorded_axis({}, 0, cycles=3))
    quarter_car = si.QuarterCar(rig) + "rail_coulomb" + "tyre_friction"
    return {"quarter car": (quarter_car, two_mass[1]), "two mass": two_mass, "axis": axis}


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is diagnosed."""

    def stop(plant: Any, data: Any, given: Any, settings: Any, *_: Any, **__: Any) -> None:
        raise _BegunError(plant.constants, settings.constants)

    for module in (dwells, public):
        monkeypatch.setattr(module, "diagnose_problem", stop)


@pytest.mark.slow
@pytest.mark.usefixtures("begun")
@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("constants", [DEFAULTS, OTHERS], ids=["defaults", "others"])
def test_constants_reach_the_diagnosis_of_every_plant(
    cases: dict[str, tuple[Any, Any]], plant: str, constants: DecisionConstants
) -> None:
    with pytest.raises(_BegunError) as begun:
        si.diagnose(*cases[plant], constants=constants)
    assert begun.value.args == (constants, constants)


ROOMS = (Path(str(each.__file__)).parent for each in (diagnosis, background))
FILES = sorted(file for room in ROOMS for file in room.glob("*.py"))


TREES = {file.name: ast.parse(file.read_text()) for file in FILES}


def _takes_constants(function: ast.FunctionDef) -> bool:
    return any(each.arg == "constants" for each in (*function.args.args, *function.args.kwonlyargs))


DECIDING = {
    each.name
    for tree in TREES.values()
    for each in tree.body
    if isinstance(each, ast.FunctionDef) and _takes_constants(each)
}
"""Functions of the diagnosis that decide by constants."""


@over("file", TREES)
def test_no_call_leaves_the_constants_out(file: str) -> None:
    assert {"score_terms", "scores_of", "laws_of_functions", "motion_problem"} <= DECIDING
    for call in ast.walk(TREES[file]):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in DECIDING:
            assert "constants" in ast.unparse(call), f"line {call.lineno}"


@over("file", TREES)
def test_no_function_decides_by_the_defaults_where_it_is_given_others(file: str) -> None:
    """The defaults are those of arguments and fields alone."""
    for function in ast.walk(TREES[file]):
        if isinstance(function, ast.FunctionDef):
            read = {
                each.id for line in function.body for each in ast.walk(line) if isinstance(each, ast.Name)
            }
            assert "DEFAULTS" not in read, function.name


@pytest.mark.slow
def test_an_effect_with_states_is_scored_at_its_typical_size_whatever_the_width_of_its_prior(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, together = si.PlantModel(si.Axis(), si.Axis.parameters), needed_forces
    motion, seen = driven_motion(recorded_axis({}, 0, cycles=3)), []

    def watched(model: Any, several: Any, along: Any, step: float) -> Needed:
        seen.append(several)
        return together(model, several, along, step)

    monkeypatch.setattr(problems, "needed_forces", watched)
    for constants in (DEFAULTS, OTHERS):
        problem, _ = motion_problem(
            motion, si.Axis(), model.table, model.catalogue, free=model.free(), constants=constants
        )
        term = next(each for each in problem.candidates if problem.catalogue[each.name].states)
        problem.sensitivities((), {}, None, (term,))
    (amplitude,) = term.amplitudes
    one, other = (np.asarray(each[amplitude.name]) for each in seen)
    assert one.size == len(term.tried)
    np.testing.assert_allclose(one, one[0])
    np.testing.assert_allclose(one, other)
