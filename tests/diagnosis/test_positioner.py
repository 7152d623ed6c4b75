"""The engine on a second plant: known truth on a simulated axis, and what the literature found on a real one."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.positioner.agreement import estimates_of
from savgs_ident.diagnosis.positioner.diagnose import PositionerDiagnosis, diagnose_positioner
from savgs_ident.diagnosis.positioner.plant import PositionerPlant, pitch_choices, positioner_data
from savgs_ident.diagnosis.positioner.preparation import motion_of
from savgs_ident.diagnosis.positioner.recording import read_positioner
from savgs_ident.diagnosis.positioner.repeatability import period_of, repeatability_of
from savgs_ident.diagnosis.positioner.selection import select_laws
from savgs_ident.diagnosis.score_test import score_terms
from savgs_ident.inference.find_map import find_map, search_of
from savgs_ident.inference.observations import MULTIPLES

from .positioner_axis import BASE, PERIOD_S, RATE_HZ, recorded_axis

PUBLISHED = {
    "mass": 95.1089,
    "viscous_friction": 203.5034,
    "coulomb_friction": 20.3935,
    "force_offset": -3.1648,
}


@cache
def _diagnosed(folder: Path) -> PositionerDiagnosis:
    return diagnose_positioner(
        read_positioner(folder / "DATA_EMPS.mat"), read_positioner(folder / "DATA_EMPS_PULSES.mat")
    )


@pytest.fixture
def real_folder(shared_data: Path) -> Path:
    folder = shared_data / "real" / "EMPS"
    if not folder.is_dir():
        pytest.skip(f"needs the recordings in {folder}")
    return folder


@pytest.fixture
def real(real_folder: Path) -> PositionerDiagnosis:
    return _diagnosed(real_folder)


def test_the_laws_of_the_literature_are_found_first(real: PositionerDiagnosis) -> None:
    assert set(real.textbook.effects) == {"coulomb", "offset"}
    assert [step.term for step in real.steps[:2]] == ["coulomb", "offset"]
    assert all(step.heldout_gain > 3.0 * step.heldout_error for step in real.steps if step.added)
    assert real.textbook.status.ok
    assert real.refined.status.ok


def test_the_published_parameters_come_out(real: PositionerDiagnosis) -> None:
    for each in real.textbook.parameters:
        assert each.value == pytest.approx(PUBLISHED[each.name], rel=0.02)
        assert each.lo < PUBLISHED[each.name] < each.hi


def test_the_force_errors_are_those_of_the_literature(real: PositionerDiagnosis) -> None:
    # Published: 4.08 % and 5.98 %, and 3.11 % with friction that differs by direction, with another low-pass.
    assert real.textbook.fitted.after == pytest.approx(0.0408, abs=0.0025)
    assert real.textbook.heldout.after == pytest.approx(0.0598, abs=0.005)
    (directed,) = (step for step in real.steps if step.term == "viscous_asymmetry")
    assert directed.error == pytest.approx(0.0311, abs=0.0025)


def test_the_share_on_the_recording_held_out(real: PositionerDiagnosis) -> None:
    gap = real.textbook.heldout
    assert gap.before > gap.recalibrated > gap.after > gap.floor
    shares = [step.share_closed for step in real.steps[:2]]
    assert shares[0] > 0.75
    assert shares[1] > 0.88
    low, high = gap.interval
    assert low < gap.share_closed < high


def test_the_offset_turns_out_to_be_friction_that_differs_by_direction(real: PositionerDiagnosis) -> None:
    assert "viscous_asymmetry" in real.details
    assert real.replaced == ("offset",)
    (directed,) = (step for step in real.steps if step.term == "viscous_asymmetry")
    (offset,) = (each for each in directed.parameters if each.name == "force_offset")
    assert abs(offset.value) < 0.1 * abs(PUBLISHED["force_offset"])
    assert offset.lo < 0.0 < offset.hi


def test_an_offset_is_not_told_from_dry_friction_that_differs_by_direction(real: PositionerDiagnosis) -> None:
    assert ("offset", "coulomb_asymmetry") in [each.effects for each in real.confusable]


def test_the_same_cogging_is_in_both_recordings(real_folder: Path, real: PositionerDiagnosis) -> None:
    assert "cogging" in real.details
    (pitch,) = (each.value for each in real.refined.parameters if each.name == "cogging_pitch")
    recording = read_positioner(real_folder / "DATA_EMPS_PULSES.mat")
    motion = motion_of(recording)
    law = next(each for each in PositionerPlant(motion).catalogue if each.term.name == "cogging")
    choices = pitch_choices(motion, law)
    plant = PositionerPlant(motion)
    search = search_of(plant, positioner_data(recording, motion, real.noise))
    others = tuple(each for each in plant.candidates if each.name in ("coulomb", "viscous_asymmetry"))
    base = find_map(search, others, {}, None)
    # Of all pitches, and with a phase of its own: the encoder counts from where it was switched on.
    (score,) = score_terms(search, base, [law.term.at_multiples(choices)])
    found = find_map(search, (*others, law.term), base.values | score.start, None)
    assert found.evidence > base.evidence + 5.0
    assert found.values["cogging_pitch"] == pytest.approx(pitch, rel=1e-3)


def test_a_diagnosis_is_said_in_a_sentence(real: PositionerDiagnosis) -> None:
    assert real.sentence.startswith(
        "Missing: coulomb, offset; the force error on the recording held out falls from 17"
    )


@pytest.mark.parametrize(
    ("laws", "effects", "seed"),
    [
        ({}, set(), 0),
        ({}, set(), 1),
        ({"coulomb": 12.0}, {"coulomb"}, 2),
        ({"coulomb": 12.0, "offset": 4.0}, {"coulomb", "offset"}, 3),
        ({"spring": 60.0}, {"spring"}, 4),
        ({"coulomb": 8.0, "viscous_difference": 30.0}, {"coulomb", "viscous_asymmetry"}, 5),
    ],
)
def test_what_was_put_in_is_named_and_nothing_else(
    laws: dict[str, float], effects: set[str], seed: int
) -> None:
    recording = recorded_axis(laws, seed)
    motion = motion_of(recording)
    data = positioner_data(recording, motion, repeatability_of(recording, motion))
    selection = select_laws(PositionerPlant(motion), data)
    assert set(selection.refined.terms) == effects
    values = selection.refined.values
    assert values["mass"] == pytest.approx(BASE["mass"], rel=0.005)
    assert values["viscous_friction"] == pytest.approx(BASE["viscous"], rel=0.02)
    if "coulomb" in laws:
        assert values["coulomb_friction"] == pytest.approx(laws["coulomb"], rel=0.02)


@pytest.mark.slow
def test_intervals_cover_the_truth_though_neighbouring_rows_agree() -> None:
    truth = {"mass": 80.0, "viscous_friction": 150.0, "coulomb_friction": 12.0, "force_offset": 4.0}
    inside = []
    for seed in range(30):
        # Noise that stays for a third of a second: rows are far from independent.
        recording = recorded_axis({"coulomb": 12.0, "offset": 4.0}, seed, noise=1.0, colour=0.997)
        motion = motion_of(recording)
        plant = PositionerPlant(motion)
        data = positioner_data(recording, motion, repeatability_of(recording, motion))
        terms = tuple(each for each in plant.candidates if each.name in ("coulomb", "offset"))
        found = estimates_of(data, find_map(search_of(plant, data), terms, {}, None))
        inside += [each.lo < truth[each.name] < each.hi for each in found]
    # 120 of 95 %: three standard errors below.
    assert np.mean(inside) > 0.89


def test_the_noise_is_that_of_the_force_whatever_friction_there_is() -> None:
    for laws in ({}, {"coulomb": 20.0, "offset": 5.0}):
        recording = recorded_axis(laws, seed=3, noise=0.5, colour=0.99)
        motion = motion_of(recording)
        # Colour 0.99 at 1 kHz is a first-order low-pass of 1.6 Hz: nearly all of it passes to the rows.
        assert repeatability_of(recording, motion) == pytest.approx(0.5, rel=0.15)
        assert period_of(recording) == round(PERIOD_S * RATE_HZ)


def test_one_cycle_tells_no_noise() -> None:
    recording = recorded_axis({}, seed=0, cycles=1)
    with pytest.raises(InputError, match="does not repeat"):
        repeatability_of(recording, motion_of(recording))


@pytest.mark.parametrize("seed", range(4))
def test_slopes_and_columns_are_derivatives_of_the_rows(seed: int) -> None:
    plant = PositionerPlant(motion_of(recorded_axis({}, seed=0)))
    terms = tuple(each.name for each in plant.candidates)
    draw = np.random.default_rng(seed)
    coordinates = plant.nuisances + tuple(c for each in plant.candidates for c in each.coordinates)
    values = {each.name: each.value(0.5 * draw.normal()) for each in coordinates}
    names, scales = list(values), {each.name: each.scale for each in coordinates}
    shapes = {each.name for term in plant.candidates for each in term.shapes}
    here = plant.predict(terms, values, names, None)
    for place, name in enumerate(names):
        step = 1e-5 * values[name] if name in shapes else 0.1 * scales[name]
        ahead, behind = (
            plant.predict(terms, values | {name: values[name] + side * step}, (), None).rows
            for side in (1, -1)
        )
        expected = (ahead - behind) / (2.0 * step)
        size = np.max(np.abs(expected)) + 1e-12
        np.testing.assert_allclose(here.slopes[:, place], expected, atol=1e-5 * size)
    for term, columns in zip(plant.candidates, plant.columns((), {}, None, plant.candidates), strict=True):
        typical = {each.name: each.centre for each in term.shapes}
        at_typical = plant.predict(
            (term.name,),
            values | dict.fromkeys((each.name for each in term.amplitudes), 0.0) | typical,
            [each.name for each in term.amplitudes],
            None,
        )
        np.testing.assert_allclose(
            columns[MULTIPLES.index(1.0) if term.shapes else 0], at_typical.slopes, atol=1e-12
        )


def test_a_law_at_its_null_does_nothing() -> None:
    plant = PositionerPlant(motion_of(recorded_axis({}, seed=0)))
    base = {each.name: each.centre for each in plant.nuisances}
    plain = plant.predict((), base, (), None).rows
    for term in plant.candidates:
        null = base | {each.name: each.centre for each in term.coordinates}
        np.testing.assert_array_equal(plant.predict((term.name,), null, (), None).rows, plain)


@pytest.mark.parametrize(("rate", "remedy"), [(200.0, "250 Hz or more"), (1000.0, "some seconds")])
def test_a_recording_that_does_not_serve_is_refused(rate: float, remedy: str) -> None:
    whole = recorded_axis({}, seed=0)
    every = round(RATE_HZ / rate)
    parts = (
        each[: 4000 if every > 1 else 900 : every]
        for each in (whole.time, whole.position, whole.reference, whole.force)
    )
    with pytest.raises(InputError, match=remedy):
        motion_of(type(whole)("short", *parts))
