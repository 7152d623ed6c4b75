"""A fit along a measured motion: known truth, the literature on a real axis, and any unit of force."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.core.values import as_values
from savgs_ident.fit.along_motion import MotionFit
from savgs_ident.recordings.axis_recording import AxisRecording
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.responses.recorded_motion import driven_motion
from savgs_ident.simulate.along_motion import needed_force
from savgs_ident.simulate.driven_plant import samples_of

from ..diagnosis.recorded_axis import BASE, axis_with, recorded_axis
from ..relaxed import with_kept_programs

EMPS = Path(__file__).resolve().parents[3] / "shared/data/real/EMPS"
TEXTBOOK = ("guide_preload", "drive_offset")
TRUTH = {
    "mass": BASE["mass"],
    "viscous_friction": BASE["viscous"],
    "guide_preload_force": 12.0,
    "drive_offset_force": -2.0,
}


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with with_kept_programs():
        yield


def _motion(seed: int = 3) -> DrivenMotion:
    return driven_motion(recorded_axis({"coulomb": 12.0, "offset": 2.0}, seed))


def _needed(laws: Mapping[str, float], seed: int, noise: float = 0.3) -> DrivenMotion:
    """A motion whose drive exerted what the textbook's model needs with parameters ``laws`` [SI], and white noise."""
    recording = recorded_axis({}, seed)
    model, motion = axis_with(*TEXTBOOK), driven_motion(recording)
    p = as_values(model.table.as_dict() | dict(laws))
    force = np.asarray(needed_force(model.build(), p, samples_of(motion, model.build()), motion.step).force)
    drawn = noise * np.random.default_rng(seed).normal(size=force.size)
    return driven_motion(replace(recording, force=force + drawn))


def _fit(motion: DrivenMotion, *effects: str, held_out: DrivenMotion | None = None) -> MotionFit:
    found = si.fit(axis_with(*effects), motion, held_out=held_out)
    assert isinstance(found, MotionFit)
    return found


def test_parameters_are_found_within_their_errors() -> None:
    fit = _fit(_needed(TRUTH, 3), *TEXTBOOK, held_out=_needed(TRUTH, 4))
    assert fit.trusted, fit.doubt
    for name, true in TRUTH.items():
        assert abs(fit[name].value - true) < 4.0 * fit[name].stderr
        assert fit[name].stderr < 0.02 * abs(true)
    assert fit.held_out is not None
    assert fit.held_out.identified < 1.2 * fit.held_out.noise < fit.held_out.as_given


def test_how_a_friction_turns_round_is_left_to_the_contact_which_takes_no_parameter_along() -> None:
    """It turns round smoothly; of the contact the order of magnitude is known."""
    fit = _fit(_motion(), *TEXTBOOK)
    _, after, noise = fit.gap
    assert after < 1.1 * noise
    for name, true in TRUTH.items():
        assert fit[name].value == pytest.approx(true, rel=5e-3)


def test_what_lacks_its_friction_is_not_trusted_and_its_errors_contain_the_truth() -> None:
    fit = _fit(_motion(), "drive_offset")
    assert not fit.trusted
    assert not fit.verdict.explained
    for name in ("mass", "viscous_friction"):
        assert abs(fit[name].value - TRUTH[name]) < 4.0 * fit[name].stderr < 4.0 * TRUTH[name]


@pytest.mark.parametrize("factor", [100.0, pytest.param(0.01, marks=pytest.mark.slow)])
def test_force_in_another_unit_gives_parameters_in_that_unit(factor: float) -> None:
    motion = _motion()
    other = replace(motion, drive=factor * motion.drive, noise=factor * motion.noise)
    fit, scaled = _fit(motion, *TEXTBOOK), _fit(other, *TEXTBOOK)
    for name in TRUTH:
        assert scaled[name].value == pytest.approx(factor * fit[name].value, rel=1e-3)
        assert scaled[name].stderr == pytest.approx(factor * fit[name].stderr, rel=1e-2)


@pytest.mark.slow
def test_the_identified_model_is_written_and_fits_as_well(tmp_path: Path) -> None:
    motion = _motion()
    fit = _fit(motion, *TEXTBOOK)
    names = {path.name for path in fit.save(tmp_path)}
    assert names == {"fit.json", "model.toml", "drive.png", "drive.pdf"}
    again = si.load_plant("axis", tmp_path / "model.toml")
    assert again.effects == fit.effects
    assert again.table["mass"].value == pytest.approx(fit["mass"].value, rel=1e-9)
    refitted = si.fit(again, motion)
    assert refitted["mass"].value == pytest.approx(fit["mass"].value, rel=1e-3)


def test_a_value_at_its_bound_is_said_to_be_there() -> None:
    motion, model = _needed(TRUTH, 3), axis_with(*TEXTBOOK)
    mass = replace(model.table["mass"], value=50.0, upper=0.9 * TRUTH["mass"])
    fit = si.fit(model.with_parameters(merge_parameters(ParameterTable((mass,)), model.table)), motion)
    (said,) = [each for each in fit.verdict.sentences if "bound" in each]
    assert said.startswith("mass ended at its upper bound, 72 kg")
    assert not [each for each in _fit(motion, *TEXTBOOK).verdict.sentences if "bound" in each]


def _written(path: Path, recording: AxisRecording) -> None:
    rows = np.stack([recording.time, recording.force, recording.position], axis=1)
    header = "time [s],drive_force [N],position [m]"
    np.savetxt(path, rows, delimiter=",", header=header, comments="")


@pytest.mark.slow
def test_motions_of_several_days_are_campaigns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The process that identifies them is not strict either.
    for name in ("JAX_NUMPY_RANK_PROMOTION", "JAX_NUMPY_DTYPE_PROMOTION"):
        monkeypatch.delenv(name)
    for day, friction in (("monday", 11.0), ("tuesday", 12.0), ("wednesday", 13.0)):
        laws = TRUTH | {"guide_preload_force": friction}
        motion = _needed(laws, 3)
        _written(tmp_path / f"{day}.csv", replace(recorded_axis({}, 3), force=motion.drive))
    study = si.run_campaigns(tmp_path, tmp_path / "out", plant="axis", beside=TEXTBOOK, workers=1)
    assert not study.failures
    found = [row.parameters["guide_preload_force"].value for row in study.rows]
    assert found == pytest.approx([11.0, 12.0, 13.0], abs=0.1)
    friction, mass = (study.trends[name].line for name in ("guide_preload_force", "mass"))
    assert friction is not None
    assert friction.rises_or_falls
    assert mass is not None
    assert not mass.rises_or_falls


def test_options_that_mean_nothing_along_a_motion_are_refused() -> None:
    with pytest.raises(si.InputError, match="neither peak-to-peak"):
        si.fit(axis_with(), _motion(), max_frequency=3.0)


@pytest.mark.slow
@pytest.mark.skipif(not EMPS.exists(), reason="published recordings are not here")
def test_a_published_axis_has_its_published_parameters() -> None:
    first, second = (si.load_motion(EMPS / name) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"))
    fit = _fit(first, *TEXTBOOK, held_out=second)
    published = {
        "mass": 95.1089,
        "viscous_friction": 203.5034,
        "guide_preload_force": 20.3935,
        "drive_offset_force": 3.1648,
    }
    for name, value in published.items():
        assert fit[name].value == pytest.approx(value, rel=0.02)
    assert fit.held_out is not None
    assert fit.gap[1] < 0.0408
    assert fit.held_out.identified < 0.0598


def test_a_model_is_held_against_another_motion_as_a_fit_holds_it_against_one_left_out() -> None:
    other = _needed(TRUTH, 4)
    fit = _fit(_needed(TRUTH, 3), *TEXTBOOK, held_out=other)
    compared = si.compare(fit.model, other)
    assert isinstance(compared, si.MotionComparison)
    assert fit.held_out is not None
    gap = compared.to_dict()["gap"]["force"]
    assert gap["model"] == pytest.approx(fit.held_out.identified, rel=1e-9)
    # Without its friction and its offset the plant needs less.
    assert gap["without_effects"] > 10.0 * gap["model"]


def test_a_posterior_agrees_with_the_fit_and_predicts_what_was_recorded() -> None:
    fit = _fit(_needed(TRUTH, 3), *TEXTBOOK)
    post = si.sample(fit, target_ess=400.0, patience=0.0)
    assert isinstance(post, si.Posterior)
    assert post.trusted, post.doubts
    for name, value in TRUTH.items():
        assert abs(post[name].median - value) < 4.0 * post[name].sd
        # By the curvature of the density in one, by draws of the density in the other.
        assert post[name].sd == pytest.approx(fit[name].stderr, rel=0.25)
    inside, rows = post.count_inside
    assert abs(inside / rows - 0.95) < 4.0 * np.sqrt(0.05 * 0.95 / rows)
    tree = post.to_arviz()
    assert tree["observed_data"]["force"].shape == (rows,)
    assert tree["posterior_predictive"]["force"].attrs["unit"] == "N"


@pytest.mark.slow
def test_campaigns_along_the_same_motion_give_no_alarm_where_nothing_is_missing(tmp_path: Path) -> None:
    fit = _fit(_needed(TRUTH, 3), *TEXTBOOK)
    study = si.false_alarms(fit.model, fit.motion, 3, folder=tmp_path, jobs=1)
    assert len(study.solved) == 3
    assert study.alarms == 0
    assert max(study.solved) < 0.0


@pytest.mark.slow
def test_what_is_missing_in_campaigns_along_the_same_motion_is_found(tmp_path: Path) -> None:
    fit = _fit(_needed(TRUTH, 3), *TEXTBOOK)
    study = si.blind_like(fit.model, fit.motion, tmp_path, 4, seed=2, shares=(0.0, 100.0, 0.0, 0.0), jobs=1)
    # What calibration does as well as the effect has no mark.
    marked = [each.located_right for each in study.scores if each.located_right is not None]
    assert len(marked) >= 2
    assert all(marked)
