"""The background: small errors that every model has are no gap, and what stands out of them is one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import no_progress
from savgs_ident.diagnosis.evidence import DiagnosisEvidence
from savgs_ident.diagnosis.model_selection import compare_models, decide_among, recalibrate
from savgs_ident.diagnosis.public import baseline_of, problem_of_dwells
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.background.port_functions import InputLocation, Law
from savgs_ident.inference.background.shared_errors import (
    errors_of_curve,
    pieces_of_curve,
    relative_change,
    with_background,
)
from savgs_ident.inference.observations import Data
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.simulate.compared_tests import measured_response

from ..fit.bench import only
from .conftest import DWELLS


def _data(tests: int = 5, rows: int = 40) -> Data:
    random = np.random.default_rng(0)
    measured = random.standard_normal(tests * rows)
    return Data(measured, np.full(measured.size, 1e-6), np.abs(measured), np.repeat(np.arange(tests), rows))


def test_every_location_has_the_material_size_however_many_functions_it_has() -> None:
    data, random = _data(), np.random.default_rng(1)
    channel = np.arange(data.measured.size) % 2
    for count in (1, 12):
        columns = random.standard_normal((data.measured.size, count)) * random.uniform(0.1, 10.0, count)
        place = InputLocation("rail", (Law(columns),), columns)
        nothing = np.zeros((data.measured.size, 0))
        there = with_background(data, channel, [place], nothing, nothing, nothing, np.arange(5.0))
        assert there.shared is not None
        size = DEFAULTS.material_error * np.sqrt(np.sum(relative_change(data, channel, there.shared) ** 2))
        assert size == pytest.approx(DEFAULTS.material_error)
        assert there.scales.discrepancy == DEFAULTS.material_error


def test_an_input_errs_in_each_test_by_itself_and_what_is_identified_drifts() -> None:
    data, nothing = _data(), np.zeros((200, 0))
    # Another order than that of the frequencies, in which the tests of the data are.
    recorded = np.array([5.0, 1.0, 3.0, 2.0, 4.0])
    there = with_background(
        data, np.zeros(200, int), [], np.ones((200, 1)), nothing, np.ones((200, 1)), recorded
    )
    assert there.shared is not None
    assert there.tolerated is not None
    size = DEFAULTS.material_error * there.shared
    np.testing.assert_allclose(size, DEFAULTS.input_error * (data.test[:, None] == np.arange(5)))
    np.testing.assert_allclose(
        there.tolerated[:, 0], DEFAULTS.drift_tolerance * ((recorded - 3.0) / 2.0)[data.test]
    )


def test_errors_that_are_no_numbers_are_refused() -> None:
    data, nothing = _data(), np.zeros((200, 0))
    drifts = np.full((200, 1), np.nan)
    with pytest.raises(InputError, match="is no number"):
        with_background(data, np.zeros(200, int), [], nothing, nothing, drifts, np.arange(5.0))


def test_the_pieces_of_a_curve_are_the_curve() -> None:
    velocity = np.concatenate([np.linspace(-0.4, 0.3, 101), [0.0]])
    force = 900.0 * velocity + 300.0 * np.sign(velocity) * np.abs(velocity) ** 0.5
    pieces = pieces_of_curve(velocity, force)
    np.testing.assert_allclose(np.sum(pieces, axis=0), force, atol=1e-9)
    # Each stands for a part of the curve alone.
    assert max(np.count_nonzero(each) for each in pieces) < 40


def test_errors_of_a_curve_are_of_the_tolerated_size_and_alike_where_velocities_are_near() -> None:
    """Read at the points themselves, the covariance of their differences is that which is said."""
    beside = np.array(DEFAULTS.curve_points)
    velocity = np.concatenate([-beside[::-1], beside])
    force = 500.0 * velocity
    errors = np.stack(errors_of_curve(velocity, force, 0.5)) / force
    side, ratio = np.sign(velocity), np.abs(np.divide.outer(velocity, velocity))
    alike = np.where(np.equal.outer(side, side), np.exp(-np.abs(np.log2(ratio))), 0.0)
    least = np.eye(velocity.size)[1:] - np.eye(velocity.size)[:1]
    np.testing.assert_allclose(least @ errors.T @ errors @ least.T, least @ alike @ least.T, atol=1e-12)


@given(reference=st.floats(0.05, 0.39), steep=st.floats(0.0, 3.0))
def test_errors_of_a_curve_take_no_energy_from_what_its_coefficient_says(
    reference: float, steep: float
) -> None:
    """Summed up along the sine itself, for a curve that is stiffer in one direction."""
    motion = np.linspace(-0.4, 0.4, 4001)
    force = 900.0 * motion + 300.0 * steep * np.maximum(motion, 0.0) ** 2
    sine = reference * np.sin(np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False))
    errors = errors_of_curve(motion, force, reference)
    energy = np.array([np.sum(np.interp(sine, motion, each) * sine) for each in (force, *errors)])
    assert np.abs(energy[1:] / energy[0]).max() < 2e-4


def _with_damper_off(rig: Rig, share: float, seed: int) -> Rig:
    random = np.random.default_rng(seed)
    off = tuple(force * (1.0 + share * float(random.standard_normal())) for force in rig.damper_force)
    return replace(rig, damper_force=off)


def _selected(rig: Rig, campaign: Path) -> DiagnosisEvidence:
    model = RigModel(rig, ("rail_coulomb", "tyre_friction"))
    response = measured_response(load_campaign(campaign), model.plant, 9)
    response = only(response, np.isin(np.round(response.frequency, 2), DWELLS))
    plant, data = problem_of_dwells(response, *baseline_of(model)[:2])
    problem = recalibrate(plant, data, {}, no_progress)
    return decide_among(problem, compare_models(problem, no_progress))


@pytest.mark.slow
@pytest.mark.parametrize(("share", "seed"), [(0.005, 1), (0.02, 2)])
def test_a_damper_table_that_is_slightly_off_is_no_gap(
    rig: Rig, nominal_campaign: Path, share: float, seed: int
) -> None:
    evidence = _selected(_with_damper_off(rig, share, seed), nominal_campaign)
    assert evidence.kind == "none"
    assert max(each.evidence for each in evidence.localisations) < evidence.findings.base.evidence + 4.0
