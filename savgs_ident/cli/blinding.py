"""Blind trials side by side, each kept as soon as it is there, and what comes out of them."""

import secrets
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from savgs_ident.cli.blind_trial import Diagnose, Draw, Plan, check_trial_folder, run_trial
from savgs_ident.cli.blind_workers import side_by_side
from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.cli.kept_trials import begin_trials, keep_trial, known_trials, marks_in
from savgs_ident.core.rig import default_rig_path, parse_rig, rig_content
from savgs_ident.diagnose.blind.draw import Shares
from savgs_ident.diagnose.blind.score import Score, score_from
from savgs_ident.report.blind_figure import confusion_figure
from savgs_ident.report.blind_html import blind_html
from savgs_ident.report.blind_record import blind_record
from savgs_ident.report.blind_text import blind_text, trial_line
from savgs_ident.report.files import prepare_folder, write_bytes, write_json
from savgs_ident.report.picture import write_figure
from savgs_ident.report.terminal import plain
from savgs_ident.simulate.compilation import use_persistent_cache

KEPT = "trials.jsonl"
"""The file in which marks are kept."""


@dataclass(frozen=True)
class Job:
    """How many trials to run, of what, and how. ``shares`` of the kinds of trials sum to 1."""

    trials: int
    seed: int | None
    jobs: int
    rig: Path | None
    shares: tuple[float, float, float, float]
    every: int
    sweep: bool
    again: bool
    command: Sequence[str]


def run_blind(job: Job, draw: Draw, diagnose: Diagnose, voice: Voice, out: Path) -> int:
    """Run the trials that are not there yet, write and tell what all say; the exit code."""
    Shares(*job.shares)
    sheet = rig_content(job.rig or default_rig_path())
    parse_rig(sheet, job.rig or default_rig_path())
    prepare_folder(out)
    use_persistent_cache()
    kept = out / KEPT
    plan = plan_of(job, sheet, kept)
    done = known_trials(kept, plan.marks(), score_from)
    if job.again or not done:
        done = []
        begin_trials(kept, plan.marks())
    with voice.working() as progress:
        # Not when it is their turn, which may be in hours.
        for number in _missing(job, done):
            check_trial_folder(plan, out, number)
        scores = _run(job, partial(run_trial, plan, draw, diagnose, out), out, done, progress)
        record = blind_record(scores, plan.marks(), job.command)
        files: list[Path] = [
            write_json(out / "blind.json", record),
            write_bytes(out / "blind.html", blind_html(scores, plan.marks(), job.command).encode()),
            *write_figure(out, "confusion", confusion_figure(scores)),
            kept,
        ]
    voice.show(blind_text(scores), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if record["trusted"]:
        return OK
    complain("Not to be trusted: the diagnosis is not right as often as it should be.")
    return NOT_TRUSTED


def plan_of(job: Job, sheet: bytes, kept: Path) -> Plan:
    """What the trials are, with the seed of an earlier run or a secret one if none was given.

    ``sheet`` is what is in the rig file.
    """
    seed = job.seed
    if seed is None:
        told = marks_in(kept).get("seed")
        seed = told if type(told) is int and told >= 0 else secrets.randbits(32)
    return Plan(job.rig or default_rig_path(), sheet, seed, job.shares, job.every, job.sweep)


def _missing(job: Job, done: Sequence[Score]) -> list[int]:
    """The numbers of the trials that are not ``done``."""
    there = {score.number for score in done}
    return [number for number in range(1, job.trials + 1) if number not in there]


def _run(
    job: Job, work: Callable[[int], Score], out: Path, done: list[Score], progress: Progress
) -> list[Score]:
    """The marks of all trials: those ``done``, and the others, each kept in ``out`` as soon as it is there."""
    scores = {score.number: score for score in done}
    missing = _missing(job, done)
    if done:
        progress(f"{len(done)} trials are there from an earlier run")
    if missing:
        progress(f"trial {missing[0]} of {job.trials}, {min(job.jobs, len(missing))} at a time")
    for score in side_by_side(work, missing, job.jobs):
        scores[score.number] = score
        keep_trial(out / KEPT, asdict(score))
        there = sum(number <= job.trials for number in scores)
        progress(f"{there} of {job.trials} trials done; {trial_line(score)}")
    return [scores[number] for number in sorted(scores) if number <= job.trials]
