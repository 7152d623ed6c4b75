"""Trials of a calibration on disk: kept, continued, refused; and what is made of them."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.report.present_validation import calibration_figure, calibration_record
from savgs_ident.validation.calibration import RANKED, CalibrationStudy, Trial
from savgs_ident.validation.trials import known_trials, marks_of

NAMES = ("mu_r", "c_sd")


def _trial(fields: dict[str, Any]) -> Trial:
    return Trial(**fields)


MODEL = RigModel(replace(read_rig(default_rig_path()), source="model.toml", sha256="as it was"))
OTHER_MODEL = RigModel(replace(MODEL.rig, sha256="as it is"))


def _marks(
    campaign: Path, channels: Path | None = None, seed: int = 1, model: RigModel = MODEL
) -> dict[str, object]:
    return marks_of(model, campaign, channels) | {"sampler": "emcee", "every": 3, "seed": seed}


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A file to take trials from."""
    (tmp_path / "campaign.csv").write_text("as it was")
    return tmp_path / "campaign.csv"


def _trials(count: int, share: float, seed: int) -> list[Trial]:
    """Trials of a sampler whose ranks are uniform and whose intervals hold ``share`` of the truths."""
    random = np.random.default_rng(seed)
    return [
        Trial(
            number,
            True,
            True,
            100.0,
            {name: int(random.integers(RANKED + 1)) for name in NAMES},
            {name: bool(random.random() < share) for name in NAMES},
        )
        for number in range(count)
    ]


def _written(path: Path, marks: dict[str, object], trials: list[Trial]) -> None:
    lines = [json.dumps(marks), *(json.dumps(asdict(trial)) for trial in trials)]
    path.write_text("\n".join(lines) + "\n")


def test_whole_trials_are_kept_and_a_line_that_was_cut_off_is_not(tmp_path: Path, campaign: Path) -> None:
    kept, trials, marks = tmp_path / "trials.jsonl", _trials(5, 0.95, 1), _marks(campaign)
    _written(kept, _marks(campaign), trials)
    kept.write_text(kept.read_text()[:-20])
    assert known_trials(kept, marks, _trial) == trials[:4]
    assert known_trials(kept, marks, _trial) == trials[:4]


def _edited(campaign: Path) -> dict[str, object]:
    campaign.write_text("as it is")
    return _marks(campaign)


def _mapped(campaign: Path) -> dict[str, object]:
    (campaign.parent / "channels.toml").write_text("")
    return _marks(campaign)


OTHERS: dict[str, Callable[[Path], dict[str, object]]] = {
    "seed": lambda campaign: _marks(campaign, seed=2),
    "channels, state of the channel map": lambda campaign: _marks(campaign, channels=campaign),
    "state of the rig file": lambda campaign: _marks(campaign, model=OTHER_MODEL),
    "state of the campaign": _edited,
    "state of the channel map": _mapped,
}


@pytest.mark.parametrize("other", OTHERS)
def test_trials_of_something_else_are_refused(other: str, tmp_path: Path, campaign: Path) -> None:
    kept = tmp_path / "trials.jsonl"
    _written(kept, _marks(campaign), _trials(2, 0.95, 1))
    marks = OTHERS[other](campaign)
    with pytest.raises(InputError, match=f"holds trials of another {other}. Remedy"):
        known_trials(kept, marks, _trial)


def test_trials_of_a_version_that_noted_less_are_refused_with_the_reason(
    tmp_path: Path, campaign: Path
) -> None:
    kept = tmp_path / "trials.jsonl"
    marks = _marks(campaign)
    kept.write_text(json.dumps({name: each for name, each in marks.items() if "sha256" not in name}) + "\n")
    said = (
        "an earlier version, which did not note the state of the campaign, state of the channel map, state of"
    )
    with pytest.raises(InputError, match=said):
        known_trials(kept, marks, _trial)


def test_a_campaign_that_is_not_there_has_no_marks(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: does not exist"):
        _marks(tmp_path / "none.csv")


def test_what_is_no_list_of_trials_is_refused(tmp_path: Path, campaign: Path) -> None:
    kept = tmp_path / "trials.jsonl"
    kept.write_text("nonsense\n")
    with pytest.raises(InputError, match="no list of trials"):
        known_trials(kept, _marks(campaign), _trial)


def test_a_right_sampler_is_found_right_and_a_bold_one_is_not() -> None:
    right = calibration_record(CalibrationStudy(tuple(_trials(200, 0.95, 2)), NAMES))
    bold = calibration_record(CalibrationStudy(tuple(_trials(200, 0.7, 3)), NAMES))
    assert right["calibrated"] is True
    assert bold["calibrated"] is False
    assert bold["coverage"] == pytest.approx(0.7, abs=0.08)


def test_a_sampler_whose_draws_lie_too_high_is_found_out_by_its_ranks() -> None:
    trials = [
        Trial(n, True, True, 100.0, dict.fromkeys(NAMES, n % 12), dict.fromkeys(NAMES, True))
        for n in range(200)
    ]
    record = calibration_record(CalibrationStudy(tuple(trials), NAMES))
    assert record["ranks_even"] is False
    assert record["calibrated"] is False


def test_a_mode_that_was_not_found_counts_as_a_miss() -> None:
    lost = [Trial(100 + n, True, False, 0.0, {}, {}) for n in range(40)]
    record = calibration_record(CalibrationStudy((*_trials(60, 1.0, 4), *lost), NAMES))
    assert record["coverage"] == pytest.approx(0.6)
    assert record["mode_not_found"] == 40
    assert record["calibrated"] is False


def test_the_picture_has_a_panel_for_every_parameter() -> None:
    figure = calibration_figure(CalibrationStudy(tuple(_trials(50, 0.95, 5)), NAMES))
    assert isinstance(figure, Figure)
    titles = [axes.get_title() for axes in figure.axes if axes.get_visible()]
    assert titles == list(NAMES)
    bars = [
        sum(patch.get_height() for patch in axes.patches if 2.0 < patch.get_width() < 10.0)
        for axes in figure.axes[:2]
    ]
    assert bars == [50, 50]
