"""Blind trials like a recorded campaign, of two masses: what is drawn, and how far it stands out."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import no_progress
from savgs_ident.diagnosis.public import AskedDwells
from savgs_ident.diagnosis.result import DiagnosisSettings
from savgs_ident.plants.model import PlantModel
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import PeriodicSettings
from savgs_ident.validation.blind_draw import LARGEST, SMALLEST, Shares
from savgs_ident.validation.blind_like import LikeBench, _Present, like_bench

from ..diagnosis.test_whole_diagnoses import ALL, FOREIGN, OFFERED, ORDERS, _recorded
from ..relaxed import as_users_have_it

ONE, TWO = Shares(0.0, 1.0, 0.0, 0.0), Shares(0.0, 0.0, 1.0, 0.0)


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with as_users_have_it():
        yield


def _bench(shares: Shares, response: HarmonicResponse | None = None) -> LikeBench:
    settings = DiagnosisSettings(
        "two_mass",
        free=("k", "c"),
        orders=ORDERS,
        periodic=PeriodicSettings(nodes=128, adaptations=0),
        without=tuple(name for name in ALL if name not in OFFERED),
    )
    model = PlantModel(TwoMass(), PARAMETERS)
    asked = AskedDwells(_recorded() if response is None else response, model, settings, {}, ())
    return like_bench(asked, shares, 3, no_progress)


@pytest.fixture(scope="module")
def bench() -> LikeBench:
    return _bench(ONE)


@pytest.mark.slow
def test_what_is_drawn_changes_the_response_by_what_it_says(bench: LikeBench) -> None:
    for number in (0, 1):
        answer, rows = bench._drawn(number, np.random.default_rng(number))
        (name,) = answer.effects
        assert name in OFFERED
        assert answer.ports == (ALL[name].port.location,)
        bare = bench.campaign.rows((), answer.rig)
        there = bench.campaign.rows((name,), {**answer.rig, **answer.parameters})
        assert bare is not None
        assert there is not None
        np.testing.assert_allclose(rows, there, rtol=1e-9, atol=1e-12)
        # Channels of tests, one by one.
        data, channel = bench.campaign.problem.data, bench.campaign.problem.plant.channel
        moved = max(
            np.linalg.norm((there - bare)[here]) / np.linalg.norm(bare[here])
            for here in ((data.test == t) & (channel == c) for t in range(9) for c in range(2))
        )
        assert moved == pytest.approx(answer.changes[name], rel=1e-6)
        assert 0.97 * SMALLEST < moved < 1.03 * LARGEST


def test_an_effect_stands_out_of_all_errors_and_of_what_calibration_does(bench: LikeBench) -> None:
    """By generalised least squares with the whole covariance matrix; along a free parameter by next to nothing."""
    base, data = bench.campaign.problem.base, bench.campaign.problem.data
    scales = base.noise_scales
    whole = np.diag(scales.noise**2 * data.variance + (scales.discrepancy * data.discrepancy_scale) ** 2)
    for columns, size in ((data.tolerated, scales.noise), (data.shared, scales.discrepancy)):
        whole += 0.0 if columns is None else size**2 * columns @ columns.T
    slopes, random = np.asarray(base.slopes), np.random.default_rng(1)
    inverse = np.linalg.inv(whole)
    moved = 5.0 * np.sqrt(np.diag(whole)) * random.standard_normal(data.measured.size)
    left = inverse - inverse @ slopes @ base.covariance() @ slopes.T @ inverse
    one = _Present(ALL["guide_viscous"], {}, 0.1, moved)
    assert bench._sigma(one, [one]) == pytest.approx(np.sqrt(moved @ left @ moved), rel=1e-6)
    (k,) = (place for place, each in enumerate(base.coordinates) if each.name == "k")
    along = _Present(ALL["guide_viscous"], {}, 0.1, 10.0 * np.sqrt(base.covariance()[k, k]) * slopes[:, k])
    alone = np.sqrt(along.moved @ inverse @ along.moved)
    assert bench._sigma(along, [along]) < 0.02 * alone
    # Beside its own double it does not stand out at all.
    assert bench._sigma(one, [one, _Present(ALL["tyre_stiffness"], {}, 0.1, 2.0 * moved)]) < 1e-3


@pytest.mark.slow
def test_a_model_that_does_not_explain_the_campaign_is_refused() -> None:
    with pytest.raises(InputError, match="the model does not explain the campaign"):
        _bench(ONE, _recorded(FOREIGN))


def test_a_trial_from_the_draw_to_its_marks(bench: LikeBench) -> None:
    score = bench.trial(0)
    answer, _ = bench._drawn(0, np.random.default_rng((3, 0)))
    assert (score.number, score.kind, score.effects) == (0, "effect", answer.effects)
    assert score.changes == pytest.approx([answer.changes[name] for name in answer.effects])
    assert score.named_right or score.left_alone
    assert score.probability is not None
    assert 0.0 <= score.probability <= 1.0
    assert all(interval.holds for interval in score.intervals.values())


@pytest.mark.slow
def test_effects_of_the_catalogue_are_named(bench: LikeBench) -> None:
    found = [bench.trial(number) for number in (1, 2, 4)]
    assert [each.effects for each in found] == [each.said for each in found]
    # The stiffness of the suspension is free: calibration takes another value of it up, whatever its name.
    assert bench.trial(3).effects == ("suspension_stiffness",)
    assert bench.trial(3).verdict == "none"
    for interval in (each for score in found for each in score.intervals.values()):
        # One of twenty truths lies outside; none so far outside, at four standard deviations.
        middle, half = 0.5 * (interval.high + interval.low), 0.5 * (interval.high - interval.low)
        assert abs(interval.true - middle) < 2.0 * half
    both = _bench(TWO).trial(1)
    assert both.kind == "two"
    assert len(both.effects) == 2


@pytest.mark.slow
def test_a_plant_of_ones_own_is_tried_on_campaigns_like_its_own_and_a_run_goes_on(tmp_path: Path) -> None:
    folder = Path(__file__).parents[2] / "examples/servo"
    campaign = folder / "tests.csv.gz"
    model = si.load_plant(f"{folder / 'servo.py'}:Servo") + "bearing_preload"
    recorded = si.load_campaign(campaign, layout=model.layout)
    study = si.blind_like(model, recorded, tmp_path, 1, jobs=1)
    kept = (tmp_path / "trials.jsonl").read_text()
    longer = si.blind_like(model, recorded, tmp_path, 2, jobs=1)
    assert (tmp_path / "trials.jsonl").read_text().startswith(kept)
    assert longer.scores[0].effects == study.scores[0].effects
    assert {*longer.scores[0].effects, *longer.scores[1].effects} <= {*model.candidates}
    longer.save(tmp_path)
    assert "Campaigns like the recorded one" in (tmp_path / "blind.html").read_text("utf-8")
    with pytest.raises(InputError, match="trials of another seed"):
        si.blind_like(model, recorded, tmp_path, 1, seed=2, jobs=1)


def test_effects_that_are_removed_from_the_catalogue_are_not_offered(tmp_path: Path) -> None:
    model = PlantModel(TwoMass(), PARAMETERS)
    with pytest.raises(InputError, match="nothing, one effect or two"):
        si.blind_like(model, _never(), tmp_path, shares=(1.0, 1.0, 1.0, 1.0))


def _never() -> si.Campaign:
    return si.Campaign("none", (), (), "")
