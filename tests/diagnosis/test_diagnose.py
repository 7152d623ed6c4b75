"""Whole diagnoses of the laboratory's labelled campaigns: named, located, closed, within intervals.

Each on few dwells; that nothing is missing on all of the shipped campaign is seen by what the README does.
"""

from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.public import SIMTR, diagnose_response
from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.fit.public import fit
from savgs_ident.inference.result import UNEXPLAINED
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

from ..fit.bench import TRUTH as PAPER_TRUTH
from ..fit.bench import only
from .conftest import DWELLS, Measure

TRUTH = {
    "stribeck_rail": ("rail_stribeck", "rail", {"stribeck_rise": 0.25, "stribeck_velocity": 0.1}),
    "mount_compliance": (
        "mount_compliance",
        "strut",
        {"mount_compliance": 1.0 / 6.0e5, "mount_damping": 400.0},
    ),
    "accel_lag": ("accel_lag", "sensor.sprung_accel", {"accel_lag_time": 0.015}),
}


def _check(diagnosis: Diagnosis, name: str) -> None:
    effect, port, truth = TRUTH[name]
    assert diagnosis.converged
    assert diagnosis.verdict.kind == "effect"
    assert diagnosis.verdict.effects == (effect,)
    assert diagnosis.verdict.ports == (port,)
    assert diagnosis.verdict.confusable_with == ()
    assert diagnosis.shrink.share_closed > 0.99
    assert diagnosis.shrink.after < 1.3 * diagnosis.shrink.floor < diagnosis.shrink.recalibrated
    best = diagnosis.candidates[0]
    assert best.effects == (effect,)
    assert best.probability > 0.99
    assert best.heldout_gain > 0.5
    for each in best.parameters:
        assert each.lo <= truth[each.name] <= each.hi, each
    assert sum(each.probability for each in diagnosis.candidates) == pytest.approx(1.0)


@pytest.mark.slow
def test_a_stribeck_rail_is_found_in_a_few_dwells(measure_few: Measure, rig: Rig) -> None:
    reported: list[str] = []
    diagnosis = diagnose_response(measure_few("stribeck_rail"), rig, progress=reported.append)
    _check(diagnosis, "stribeck_rail")
    assert diagnosis.ports[0].port == "rail"
    assert len(reported) > 5
    law = diagnosis.loops[1]
    assert law.port == "rail"
    assert law.law.size == law.inferred.size == law.velocity.size


def test_an_effect_that_does_not_exist_is_refused(measure: Measure, rig: Rig) -> None:
    with pytest.raises(InputError, match="there is no effect 'rail_stribek'"):
        diagnose_response(measure("nominal"), rig, replace(SIMTR, without=("rail_stribek",)))


@pytest.mark.slow
def test_an_effect_of_the_baseline_cannot_be_left_out(measure: Measure, rig: Rig) -> None:
    with pytest.raises(InputError, match="'rail_coulomb' is part of the baseline"):
        diagnose_response(measure("nominal"), rig, replace(SIMTR, without=("rail_coulomb",)))


@pytest.mark.slow
def test_a_lag_is_found_in_a_few_dwells(measure_few: Measure, rig: Rig) -> None:
    _check(diagnose_response(measure_few("accel_lag"), rig), "accel_lag")


@pytest.mark.slow
def test_a_mount_is_found_in_the_fastest_dwells(measure: Measure, rig: Rig) -> None:
    response = measure("mount_compliance")
    fastest = response.frequency >= np.sort(response.frequency)[-len(DWELLS)]
    _check(diagnose_response(only(response, fastest), rig), "mount_compliance")


@pytest.mark.slow
@pytest.mark.parametrize("recorded", TRUTH)
def test_with_the_effect_that_is_named_a_fit_is_to_be_trusted(
    recorded: str, measure_few: Measure, rig: Rig
) -> None:
    effect, _, truth = TRUTH[recorded]
    lacking, response = RigModel(rig, SIMTR.baseline), measure_few(recorded)
    alone, found = fit(lacking, response), fit(lacking + effect, response)
    assert alone.doubt == UNEXPLAINED
    assert found.trusted
    expected = {**PAPER_TRUTH, **truth}
    assert len(found.free_names) == 4 + len(truth)
    for name in found.free_names:
        each = found.by_name[name]
        assert abs(each.value - expected[name]) < 3.0 * each.stderr, each
