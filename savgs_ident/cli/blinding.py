"""Blind trials side by side, each kept as soon as it is there, and what comes out of them."""

import json
import secrets
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from savgs_ident.cli.blind_trial import Diagnose, Draw, Plan, run_trial
from savgs_ident.cli.blind_workers import side_by_side
from savgs_ident.cli.console import Progress, Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK
from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import default_rig_path, read_rig
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


@dataclass(frozen=True)
class Job:
    """How many trials to run, of what, and how."""

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
    read_rig(job.rig or default_rig_path())
    prepare_folder(out)
    use_persistent_cache()
    kept = out / "trials.jsonl"
    plan = plan_of(job, kept)
    done = known_scores(kept, plan)
    if job.again or not done:
        done = []
        _keep(kept, [plan.marks()])
    with voice.working() as progress:
        scores = _run(job, partial(run_trial, plan, draw, diagnose, out), kept, done, progress)
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


def plan_of(job: Job, kept: Path) -> Plan:
    """What the trials are, with the seed of an earlier run or a secret one if none was given."""
    seed = job.seed
    if seed is None:
        earlier = _first_line(kept) if kept.exists() else {}
        told = earlier.get("seed")
        seed = told if isinstance(told, int) else secrets.randbits(32)
    return Plan(job.rig or default_rig_path(), seed, job.shares, job.every, job.sweep)


def _run(
    job: Job, work: Callable[[int], Score], kept: Path, done: list[Score], progress: Progress
) -> list[Score]:
    scores = {score.number: score for score in done}
    missing = [number for number in range(1, job.trials + 1) if number not in scores]
    if done:
        progress(f"{len(done)} trials are there from an earlier run")
    if missing:
        progress(f"trial {missing[0]} of {job.trials}, {min(job.jobs, len(missing))} at a time")
    for score in side_by_side(work, missing, job.jobs):
        scores[score.number] = score
        with kept.open("a") as stream:
            stream.write(json.dumps(asdict(score)) + "\n")
        there = sum(number <= job.trials for number in scores)
        progress(f"{there} of {job.trials} trials done; {trial_line(score)}")
    return [scores[number] for number in sorted(scores) if number <= job.trials]


def known_scores(kept: Path, plan: Plan) -> list[Score]:
    """The marks of an earlier run; a last line that was cut off is left out and the file mended.

    Raises :class:`InputError` for trials of another plan, and for a file that is no list of trials.
    """
    if not kept.exists():
        return []
    marks = _first_line(kept)
    if marks != plan.marks():
        raise InputError(
            "holds trials of another rig, seed, programme or other shares",
            source=kept,
            remedy="name another --out DIR, or remove the file",
        )
    lines = kept.read_text().split("\n")[1:-1]
    try:
        found = [score_from(json.loads(line)) for line in lines]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _no_list(kept) from error
    _keep(kept, [marks, *map(asdict, found)])
    return found


def _keep(kept: Path, lines: Sequence[object]) -> None:
    """Write all lines, whole or not at all."""
    write_bytes(kept, "".join(json.dumps(line) + "\n" for line in lines).encode())


def _first_line(kept: Path) -> dict[str, object]:
    """What the trials in a file have in common; empty if not even that line is whole."""
    first, ended, _ = kept.read_text().partition("\n")
    if not ended:
        return {}
    try:
        marks = json.loads(first)
    except ValueError as error:
        raise _no_list(kept) from error
    if not isinstance(marks, dict):
        raise _no_list(kept)
    return marks


def _no_list(kept: Path) -> InputError:
    return InputError("is no list of trials", source=kept, remedy="remove it, or name another --out DIR")
