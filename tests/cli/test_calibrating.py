"""Trials of a calibration on disk: kept, continued, refused; and what is made of them."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from savgs_ident.cli.calibrating import Job
from savgs_ident.cli.kept_trials import known_trials
from savgs_ident.core.errors import InputError
from savgs_ident.posterior.calibration import RANKED, Trial
from savgs_ident.report.calibration import calibration_figure, calibration_record

NAMES = ("mu_r", "c_sd")


def _trial(fields: dict[str, Any]) -> Trial:
    return Trial(**fields)


def _job(seed: int = 1) -> Job:
    return Job(Path("model.toml"), Path("campaign.csv"), None, 10, "emcee", 3, seed, True, ("savgs-ident",))


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


def _written(path: Path, job: Job, trials: list[Trial]) -> None:
    lines = [json.dumps(job.marks()), *(json.dumps(asdict(trial)) for trial in trials)]
    path.write_text("\n".join(lines) + "\n")


def test_whole_trials_are_kept_and_a_line_that_was_cut_off_is_not(tmp_path: Path) -> None:
    kept, trials = tmp_path / "trials.jsonl", _trials(5, 0.95, 1)
    _written(kept, _job(), trials)
    kept.write_text(kept.read_text()[:-20])
    assert known_trials(kept, _job().marks(), _trial) == trials[:4]
    assert known_trials(kept, _job().marks(), _trial) == trials[:4]


def test_trials_of_another_seed_are_refused(tmp_path: Path) -> None:
    kept = tmp_path / "trials.jsonl"
    _written(kept, _job(), _trials(2, 0.95, 1))
    with pytest.raises(InputError, match="trials of another seed"):
        known_trials(kept, _job(seed=2).marks(), _trial)


def test_what_is_no_list_of_trials_is_refused(tmp_path: Path) -> None:
    kept = tmp_path / "trials.jsonl"
    kept.write_text("nonsense\n")
    with pytest.raises(InputError, match="no list of trials"):
        known_trials(kept, _job().marks(), _trial)


def test_a_right_sampler_is_found_right_and_a_bold_one_is_not() -> None:
    right = calibration_record(_trials(200, 0.95, 2), NAMES, ("x",))
    bold = calibration_record(_trials(200, 0.7, 3), NAMES, ("x",))
    assert right["calibrated"] is True
    assert bold["calibrated"] is False
    assert bold["coverage"] == pytest.approx(0.7, abs=0.08)


def test_a_sampler_whose_draws_lie_too_high_is_found_out_by_its_ranks() -> None:
    trials = [
        Trial(n, True, True, 100.0, dict.fromkeys(NAMES, n % 12), dict.fromkeys(NAMES, True))
        for n in range(200)
    ]
    record = calibration_record(trials, NAMES, ("x",))
    assert record["ranks_even"] is False
    assert record["calibrated"] is False


def test_a_mode_that_was_not_found_counts_as_a_miss() -> None:
    lost = [Trial(100 + n, True, False, 0.0, {}, {}) for n in range(40)]
    record = calibration_record([*_trials(60, 1.0, 4), *lost], NAMES, ("x",))
    assert record["coverage"] == pytest.approx(0.6)
    assert record["mode_not_found"] == 40
    assert record["calibrated"] is False


def test_the_picture_has_a_panel_for_every_parameter() -> None:
    figure = calibration_figure(_trials(50, 0.95, 5), NAMES)
    assert isinstance(figure, Figure)
    titles = [axes.get_title() for axes in figure.axes if axes.get_visible()]
    assert titles == list(NAMES)
    bars = [
        sum(patch.get_height() for patch in axes.patches if 2.0 < patch.get_width() < 10.0)
        for axes in figure.axes[:2]
    ]
    assert bars == [50, 50]
