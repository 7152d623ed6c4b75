"""What commands leave behind to go on from: results of campaigns, trials, draws, chains."""

import gzip
import json
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import emcee
import numpy as np
from emcee.backends import HDFBackend

from fuzz.loader import Original
from fuzz.recordings import packed_table
from savgs_ident.campaigns.store import FILES, MadeFrom, StoredResult, load_result, save_result
from savgs_ident.campaigns.study import row_of, study_campaigns
from savgs_ident.core.files import to_json
from savgs_ident.core.presentation import NO_ORIGIN
from savgs_ident.inference.samplers import nuts as nuts_sampler
from savgs_ident.inference.samplers.chains import new_checkpoint, open_checkpoint
from savgs_ident.plants.parameter_toml import file_content
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.report.blind import blind_record
from savgs_ident.report.campaigns.record import campaigns_columns, campaigns_record
from savgs_ident.report.present_validation import alarms_record, calibration_record
from savgs_ident.validation.blind import BlindRequest, plan_of
from savgs_ident.validation.blind_answer import Answer, Envelope, sealed
from savgs_ident.validation.blind_score import Interval, Score, score_from
from savgs_ident.validation.blind_trial import Drawn, Plan, run_trial
from savgs_ident.validation.calibration import CalibrationStudy, Trial, trial_reader
from savgs_ident.validation.false_alarms import AlarmStudy, NullDraw, read_draw
from savgs_ident.validation.trials import known_trials
from savgs_ident.validation.virtual_campaign import FILE
from savgs_ident.validation.virtual_rig import Bench

CASE = "case"
MARKS: dict[str, object] = {"seed": 4, "campaign": "campaign.csv.gz", "every": 1}
_MADE_FROM = MadeFrom("ab" * 32, ("campaign.csv.gz",), None, "cd" * 32, {"effects": ["rail_coulomb"]})
_BLIND = BlindRequest(3, None, 1, None, (20.0, 50.0, 15.0, 15.0), 1, False, False, ("savgs-ident", "blind"))
_PLAN = Plan(default_rig_path(), file_content(default_rig_path()), 4, _BLIND.shares, 1, False)
_NUMBER = 1


def kept_seal() -> Original:
    """What says that the result of a campaign is whole, beside that result."""
    files = _result()
    return Original((files["nominal/done.json"],), files)


def kept_fit() -> Original:
    """The result beside what says that it is whole."""
    files = _result()
    return Original((files[f"nominal/{FILES[0]}"],), files)


def kept_blind() -> Original:
    """Marks of blind trials of every kind."""
    marks = _PLAN.marks()
    return _lines(marks, [_score("none"), _score("effect", "accel_lag"), _score("unknown", "cam_scale")])


def kept_draws() -> Original:
    """Campaigns drawn with nothing missing."""
    draws = [
        NullDraw(0, -4.5, False, ()),
        NullDraw(1, None, False, ()),
        NullDraw(2, 8.0, True, ("accel_lag",)),
    ]
    return _lines(MARKS, draws)


def kept_trials() -> Original:
    """Trials of a calibration."""
    trials = [
        Trial(number, True, True, 120.0, {"mu_r": 30 + number, "c_sd": 9}, {"mu_r": True, "c_sd": False})
        for number in range(3)
    ]
    return _lines(MARKS, [*trials, Trial(3, False, False, 0.0, {}, {})])


def blind_seal() -> Original:
    """The seal of a recorded trial."""
    return _blind("campaign/seal.json")


def blind_answer() -> Original:
    """The answer of a recorded trial."""
    return _blind("answer.json")


def nuts_chain() -> Original:
    """A chain of NUTS."""
    random = np.random.default_rng(3)
    state = nuts_sampler.State(
        random.standard_normal((6, 4, 5)), -random.random((6, 4)), random.random((6, 4)) < 0.8,
        random.random((6, 4)), random.standard_normal((4, 5)), -random.random((2, 4)), np.array(0.3), np.array(0),
    )  # fmt: skip
    return _chain(lambda path: nuts_sampler.save_state(path, state))


def emcee_chain() -> Original:
    """A chain of emcee."""

    def write(path: Path) -> None:
        sampler = emcee.EnsembleSampler(
            8, 2, lambda points: -np.sum(points**2, axis=1), backend=HDFBackend(str(path)), vectorize=True
        )
        start = emcee.State(
            np.random.default_rng(2).standard_normal((8, 2)),
            random_state=np.random.RandomState(1).get_state(),
        )
        sampler.run_mcmc(start, 6)

    return _chain(write)


def read_result(path: Path) -> object:
    """The row of a campaign in the study of all; None if it would be identified anew."""
    kept = load_result(path.parent, _MADE_FROM.digest)
    if kept is None:
        return None
    row = row_of("nominal", "campaign.csv.gz", kept.record, kept.start, _MADE_FROM.data_sha256)
    study = study_campaigns([row, replace(row, name="other", start=1.7e9)], str, {}, NO_ORIGIN)
    to_json(campaigns_record(study, {}, ()))
    return row, campaigns_columns(study)


def read_blind(path: Path) -> object:
    """The marks of an earlier run, and the record of them."""
    plan = plan_of(_BLIND, _PLAN.sheet, path)
    found = known_trials(path, plan.marks(), score_from)
    return found, to_json(blind_record(found, plan.marks(), ())), _is_seed(plan.seed)


def read_draws(path: Path) -> object:
    """The draws of an earlier run, and the record of them."""
    found = known_trials(path, MARKS, read_draw)
    return found, to_json(alarms_record(AlarmStudy(tuple(found), 3.0)))


def read_trials(path: Path) -> object:
    """The trials of an earlier run, and the record of them."""
    found = known_trials(path, MARKS, trial_reader())
    names = sorted(next((each.rank for each in found if each.rank), {}))
    return found, to_json(calibration_record(CalibrationStudy(tuple(found), tuple(names))))


def read_blind_seal(path: Path) -> object:
    """The marks of a recorded trial."""
    return run_trial(_PLAN, _never_drawn, _none_found, path.parents[2], _NUMBER)


def read_blind_answer(path: Path) -> object:
    """The same; None where the trial is recorded anew."""
    try:
        return run_trial(_PLAN, _never_drawn, _none_found, path.parents[1], _NUMBER)
    except _AnewError:
        return None


def read_nuts_chain(path: Path) -> object:
    """The state that NUTS goes on from."""
    keep = open_checkpoint(path, CASE)
    with keep.scratch() as scratch:
        return nuts_sampler.load_state(scratch), keep.counts


def read_emcee_chain(path: Path) -> object:
    """The state that emcee goes on from, and its chain."""
    keep = open_checkpoint(path, CASE)
    with keep.scratch() as scratch:
        backend = HDFBackend(str(scratch))
        last = backend.get_last_sample()
        return last.coords, last.log_prob, backend.get_chain(), keep.counts


class _AnewError(Exception):
    """The trial is not there and would be drawn."""


def _never_drawn(plan: Plan, bench: Bench, number: int) -> Drawn:
    raise _AnewError


def _none_found(folder: Path, rig: Rig, without: tuple[str, ...]) -> dict[str, Any]:
    verdict = {"kind": "none", "effects": [], "ports": [], "confusable_with": [], "sentence": ""}
    return {"verdict": verdict, "which": [], "shrink": {"share_closed": None}, "wall_s": 1.0}


def _is_seed(seed: int) -> float:
    return 0.0 if seed >= 0 else float("nan")


def _lines(marks: dict[str, Any], trials: list[Any]) -> Original:
    return Original((b"".join(json.dumps(each).encode() + b"\n" for each in [marks, *map(asdict, trials)]),))


def _score(kind: Any, *effects: str) -> Score:
    one, there = kind == "effect", True if effects else None
    return Score(
        1, kind, effects, tuple(0.1 for _ in effects), kind, effects if one else (), one or None, one or None, there,
        there, False if kind == "none" else None, True if kind == "unknown" else None, None, 0.9,
        {"accel_lag_time": Interval(0.01, 0.009, 0.011)} if one else {}, 60.0,
    )  # fmt: skip


@lru_cache(maxsize=1)
def _result() -> dict[str, bytes]:
    numbers = {"mu_r": (0.03, 0.001, "1"), "c_sd": (5792.0, 12.0, "N s/m"), "m_s": (320.0, 1.0, "kg")}
    record = {
        "schema": 1,
        "parameters": {
            name: {
                "value": value,
                "stderr": stderr,
                "own_stderr": 0.9 * stderr,
                "unit": unit,
                "free": name != "m_s",
                "prior_sd": 1.25,
            }
            for name, (value, stderr, unit) in numbers.items()
        },
        "correlation": {"mu_r": {"m_s": 0.0}, "c_sd": {"m_s": 0.6}},
        "chi2_per_dof": 1.05,
        "trusted": True,
        "converged": True,
        "status": "converged",
        "advice": "converged",
    }
    with TemporaryDirectory() as parent:
        folder = Path(parent) / "nominal"
        save_result(folder, StoredResult(json.dumps(record), 'name = "gt_rear"\n', 1.76e9), _MADE_FROM)
        return {f"nominal/{each.name}": each.read_bytes() for each in folder.iterdir()}


@lru_cache(maxsize=1)
def _blind_files() -> dict[str, bytes]:
    answer = Answer(_NUMBER, "none", (), (), {}, {}, (), {}, {"m_s": 319.0}, ())
    campaign = gzip.decompress(packed_table().contents[0])
    with TemporaryDirectory() as folder:
        path = Path(folder) / FILE
        path.write_bytes(gzip.compress(campaign, mtime=0))
        envelope = Envelope(answer, "ab" * 16)
        seal = sealed(envelope, load_campaign(folder).sha256)
        opened = {"trial": _NUMBER, "settings": _PLAN.marks()} | asdict(envelope)
        return {
            f"trial_0001/campaign/{FILE}": path.read_bytes(),
            "trial_0001/campaign/seal.json": json.dumps({"without": [], "seal": asdict(seal)}).encode(),
            "trial_0001/answer.json": json.dumps(opened).encode(),
        }


def _blind(name: str) -> Original:
    files = _blind_files()
    return Original((files[f"trial_0001/{name}"],), files)


def _chain(write: Callable[[Path], None]) -> Original:
    with TemporaryDirectory() as folder:
        scratch, path = Path(folder) / "scratch.h5", Path(folder) / "chain.h5"
        write(scratch)
        new_checkpoint(path, CASE).publish(scratch, (48, 1))
        return Original((path.read_bytes(),))
