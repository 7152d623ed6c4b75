"""The draw of foreign trials, their small errors, and one whole trial."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.plants.parameter_toml import file_content
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS
from savgs_ident.plants.quarter_car.model import FREE
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path
from savgs_ident.validation.blind import FILE, FOREIGN_SHARES, BlindRequest, check_shares, plan_of
from savgs_ident.validation.blind_answer import Answer
from savgs_ident.validation.blind_draw import LARGEST, SMALLEST, Shares
from savgs_ident.validation.blind_trial import Plan, draw_and_record, record_trial
from savgs_ident.validation.foreign_draw import (
    COLOUR,
    DAMPER_ERROR,
    DRIFT,
    PHASE,
    draw_foreign,
    draw_small_errors,
    true_bench,
)
from savgs_ident.validation.foreign_laws import FOREIGN
from savgs_ident.validation.trials import code_version
from savgs_ident.validation.virtual_motions import steady_dwells
from savgs_ident.validation.virtual_rig import RANGES, Bench, Programme, Sensors, change_of

from ..relaxed import with_kept_programs

DWELLS = (1.4, 2.35, 5.5)


@pytest.fixture(scope="module")
def bench(rig: Rig) -> Bench:
    return Bench(rig, MODELS["simtr"], FREE, Programme(DWELLS, standstill=2.0))


def test_small_errors_are_as_large_as_they_should_be(rig: Rig) -> None:
    drawn = [draw_small_errors(rig, np.random.default_rng(seed)) for seed in range(200)]
    still = rig.damper_velocity.index(0.0)
    sizes = [np.sqrt(np.mean(np.delete(each.damper, still) ** 2)) for each in drawn]
    assert min(sizes) >= DAMPER_ERROR[0]
    assert max(sizes) <= DAMPER_ERROR[1]
    assert all(each.damper[still] == 0.0 for each in drawn)
    for name, most in (("drift", DRIFT), ("phase", PHASE)):
        values = np.array([getattr(each, name) for each in drawn])
        assert np.max(np.abs(values)) <= most
        assert np.min(values) < -0.8 * most
        assert np.max(values) > 0.8 * most
    assert 0.0 <= min(each.colour for each in drawn) <= max(each.colour for each in drawn) <= COLOUR
    assert draw_small_errors(rig, np.random.default_rng(3)) == drawn[3]


def test_the_rig_of_a_trial_has_its_small_errors(bench: Bench) -> None:
    errors = draw_small_errors(bench.rig, np.random.default_rng(2))
    true = true_bench(bench, _answer(small_errors=errors))
    ratio = np.array(true.rig.damper_force) / np.where(
        np.array(bench.rig.damper_force) == 0.0, 1.0, bench.rig.damper_force
    )
    moving = np.array(bench.rig.damper_velocity) != 0.0
    np.testing.assert_allclose(ratio[moving] - 1.0, np.array(errors.damper)[moving], atol=0.03)
    assert (true.sensors.colour, true.sensors.phase) == (errors.colour, errors.phase)
    friction = [float(p["mu_r"]) for p in true.values_during({"mu_r": 0.03})]
    assert friction[-1] - friction[0] == pytest.approx(0.03 * errors.drift)
    assert np.mean(friction) == pytest.approx(0.03)
    assert true_bench(bench, _answer()) is bench
    assert set(bench.catalogue) == set(CATALOGUE)


def _answer(**changes: object) -> Answer:
    return replace(Answer(1, "none", (), (), {}, {}, (), {}, {}, ()), **changes)


def test_coloured_noise_has_unit_variance_and_its_correlation() -> None:
    noise = Sensors(colour=0.5).noise((3, 40000), np.random.default_rng(1))
    assert np.std(noise, axis=1) == pytest.approx(1.0, rel=0.05)
    for row in noise:
        assert np.corrcoef(row[1:], row[:-1])[0, 1] == pytest.approx(0.5, abs=0.03)
    white = Sensors().noise((3, 10), np.random.default_rng(1))
    assert np.array_equal(white, np.random.default_rng(1).standard_normal((3, 10)))


def test_filters_and_converters_are_those_of_a_logger() -> None:
    sensors = Sensors(corner=200.0, bits=16)
    passed = sensors.filtered(np.array([0.0, 5.0, 200.0]))
    assert passed[0] == 1.0
    assert abs(passed[1]) == pytest.approx(1.0, abs=1e-5)
    assert abs(passed[2]) == pytest.approx(np.sqrt(0.5))
    given = np.array([[0.01234567], [9.87654321], [0.2]])
    read = sensors.converted(given)
    assert np.all(np.abs(read - given)[:2, 0] <= np.array(RANGES[:2]) / 2**16 * (1.0 + 1e-9))
    assert read[2, 0] < RANGES[2]
    assert np.array_equal(Sensors().converted(given), given)
    assert np.array_equal(Sensors().filtered(np.array([7.0])), [1.0])


def test_foreign_trials_have_nothing_or_one_effect() -> None:
    request = BlindRequest(1, 1, 1, None, FOREIGN_SHARES, 1, False, False, foreign=True)
    check_shares(request)
    with pytest.raises(InputError, match="foreign trials have nothing or one effect"):
        check_shares(replace(request, shares=(20.0, 50.0, 15.0, 15.0)))


def test_only_foreign_trials_are_marked_as_such() -> None:
    rig = default_rig_path()
    plan = Plan(rig, file_content(rig), 4, FOREIGN_SHARES, 1, False)
    assert "foreign" not in plan.marks()
    assert replace(plan, foreign=True).marks() == plan.marks() | {"foreign": True}


def test_the_code_has_a_version() -> None:
    assert code_version()
    assert " " not in code_version()


@pytest.mark.slow
def test_draws_can_be_repeated_and_change_the_response_by_what_was_drawn(bench: Bench) -> None:
    with with_kept_programs():
        shares = Shares(0.0, 1.0, 0.0, 0.0)
        first, again = (draw_foreign(bench, shares, 3, np.random.default_rng(11)) for _ in range(2))
        assert first == again
        (name,) = first.effects
        assert name in FOREIGN
        assert SMALLEST * 0.98 <= first.changes[name] <= LARGEST * 1.02
        assert set(first.parameters) == {each.name for each in FOREIGN[name].effect.parameters}
        nothing = draw_foreign(bench, Shares(1.0, 0.0, 0.0, 0.0), 3, np.random.default_rng(11))
        assert (nothing.kind, nothing.effects) == ("none", ())
        assert nothing.small_errors is not None
        assert nothing.rig == first.rig


@pytest.mark.slow
def test_the_fixed_step_comes_to_the_periodic_motion(bench: Bench) -> None:
    """Laws with states of their own, by the integration that is recorded and by collocation."""
    names = ("joint_bouc_wen", "damper_end_play", "body_hardening_oscillator")
    with with_kept_programs():
        parameters = {each.name: each.value for name in names for each in FOREIGN[name].effect.parameters}
        errors = draw_small_errors(bench.rig, np.random.default_rng(2))
        truth = _answer(effects=names, parameters=parameters, small_errors=replace(errors, drift=0.0))
        true = true_bench(bench, truth)
        steady = steady_dwells(true.model(names), true.values_during(parameters), DWELLS, true.step)
        found = [np.fft.rfft(each.readings)[:, :10] / 1024 for each in steady if each.status.ok]
        solution = true.solve(names, parameters)
        assert solution is not None
        assert len(found) == len(DWELLS)
        assert change_of(np.stack(found), true.response(names, parameters, solution)) < 5e-3


@pytest.mark.slow
def test_a_whole_foreign_trial(tmp_path: Path) -> None:
    """Of a rig with small errors, recorded first, then diagnosed: sealed, opened, marked, and no alarm."""
    with with_kept_programs():
        request = BlindRequest(1, 7, 0, None, (1.0, 0.0, 0.0, 0.0), 9, False, False, foreign=True)
        plan = plan_of(request, file_content(default_rig_path()), tmp_path / FILE)
        folder = record_trial(plan, draw_and_record, tmp_path, 1)
        answer = json.loads((folder / "answer.json").read_text())["answer"]
        recorded = (folder / "campaign" / "campaign.csv.gz").read_bytes()
        study = si.blind(tmp_path, 1, seed=7, shares=(1.0, 0.0, 0.0, 0.0), every=9, foreign=True, jobs=0)
    assert (folder / "campaign" / "campaign.csv.gz").read_bytes() == recorded
    (score,) = study.scores
    assert score.effects == tuple(answer["effects"])
    assert (score.foreign, score.false_alarm) == (True, False)
    assert score.probability is not None
    assert 0.0 <= score.probability <= 1.0
    assert score.version == code_version()
    assert json.loads((tmp_path / "trials.jsonl").read_text().split("\n")[1]) == json.loads(
        json.dumps(asdict(score))
    )
