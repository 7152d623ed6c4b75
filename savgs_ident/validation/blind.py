"""Blind trials: how often the diagnosis is right about effects that it does not know.

    study = blind("out/blind", trials=60, seed=1)
    print(study)                            # the rates with their intervals, and where it was wrong

Trials run side by side, each is kept as soon as it is there (:mod:`savgs_ident.validation.trials`); one trial from
the draw to its marks is :mod:`savgs_ident.validation.blind_trial`. A run that goes on marks the diagnoses that are
there by the rules of its own version.
"""

import secrets
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import prepare_folder
from savgs_ident.core.presentation import Origin, Progress, Result, no_progress
from savgs_ident.plants.parameter_toml import file_content
from savgs_ident.plants.quarter_car.rig import default_rig_path, parse_rig
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.validation.blind_draw import Shares
from savgs_ident.validation.blind_rates import rates_of
from savgs_ident.validation.blind_score import Score, score_from
from savgs_ident.validation.blind_trial import (
    Diagnose,
    Draw,
    Plan,
    check_trial_folder,
    diagnose_by_other_constants,
    diagnose_folder,
    draw_and_record,
    kept_trials,
    marked_anew,
    run_trial,
)
from savgs_ident.validation.trials import append_trial, begin_trials, known_trials, marks_in, side_by_side
from savgs_ident.validation.varied_constants import MovedMarks, moved_marks

FILE = "trials.jsonl"
"""The file in which marks are kept."""

SHARES = (20.0, 50.0, 15.0, 15.0)
"""How often nothing is missing, one effect, two, or one that is removed from the catalogue."""

FOREIGN_SHARES = (30.0, 70.0, 0.0, 0.0)
"""The same of foreign trials, whose one effect follows a foreign law."""


@dataclass(frozen=True)
class BlindStudy(Result):
    """The marks of blind trials, and what the trials have in common; what they would be by other constants."""

    presenter: ClassVar[str] = "BLIND_STUDY"

    scores: tuple[Score, ...]
    settings: Mapping[str, Any]
    moved: tuple[MovedMarks, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether every rate keeps its bounds."""
        return all(rate.met is not False for rate in rates_of(self.scores).values())


@dataclass(frozen=True)
class BlindRequest:
    """How many trials to run, of what, and how; see :func:`blind`."""

    trials: int
    seed: int | None
    jobs: int | None
    rig: Path | None
    shares: tuple[float, float, float, float]
    every: int
    sweep: bool
    again: bool
    command: tuple[str, ...] = ()
    scheduler: str | None = None
    foreign: bool = False


def blind(
    folder: str | Path,
    trials: int = 60,
    *,
    seed: int | None = None,
    rig: str | Path | None = None,
    shares: tuple[float, float, float, float] | None = None,
    every: int = 1,
    sweep: bool = False,
    foreign: bool = False,
    again: bool = False,
    sensitivity: bool = False,
    jobs: int | None = None,
    scheduler: str | None = None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> BlindStudy:
    """Try the diagnosis on campaigns whose effect is withheld, and count how often it is right.

    A rig is drawn in secret: its parameters within their tolerances, with nothing missing, one effect, two, or one
    that is removed from the catalogue. Its campaign is simulated in time, with noise; the answer is sealed; the
    diagnosis gets the recordings; then the seal is opened. Takes minutes a trial.

    In ``foreign`` trials nothing is missing, or one effect that follows a law which the diagnosis does not have.
    Every rig has small errors then: its damper's table, drifting friction, coloured noise, the phase of the road.

    Args:
        folder: where recordings and marks are kept; a run that was stopped goes on from there.
        trials: how many campaigns are drawn.
        seed: of all that is drawn; a secret one, or that of the folder, if left out.
        rig: drawing of the rig; the shipped one if left out.
        shares: how often nothing is missing, one effect, two, or one that is removed from the catalogue; 20, 50,
            15, 15 if left out, in foreign trials 30, 70, 0, 0.
        every: record every so many dwells only: quicker, harder.
        sweep: record a sweep of a minute, too.
        foreign: effects follow laws that the diagnosis does not have, on rigs with small errors.
        again: diagnose the recordings in the folder anew; keep none of the marks.
        sensitivity: give every new trial its verdicts by decision constants halved and doubled, too.
        jobs: trials at a time on this machine, each in a process of its own; one for each core if left out, 0 for
            one after the other in this process.
        scheduler: address of a Dask cluster to work on instead, whose workers see the folder under the same path.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Raises :class:`InputError` for a rig that cannot be read, and for a folder with trials of something else.
    """
    sheet = None if rig is None else Path(rig)
    given = shares or (FOREIGN_SHARES if foreign else SHARES)
    asked = BlindRequest(
        trials, seed, jobs, sheet, given, every, sweep, again, tuple(command), scheduler, foreign
    )
    diagnose = diagnose_by_other_constants if sensitivity else diagnose_folder
    return run_blind(asked, draw_and_record, diagnose, Path(folder), progress)


def run_blind(
    request: BlindRequest, draw: Draw, diagnose: Diagnose, out: Path, progress: Progress = no_progress
) -> BlindStudy:
    """Run the trials that are not in the folder ``out`` yet; ``draw`` makes their rigs, ``diagnose`` is tried."""
    check_shares(request)
    rig = request.rig or default_rig_path()
    sheet = file_content(rig)
    parse_rig(sheet, rig)
    prepare_folder(out)
    use_persistent_cache()
    kept = out / FILE
    plan = plan_of(request, sheet, kept)
    done = marked_anew(out, known_trials(kept, plan.marks(), score_from))
    if request.again or not done:
        done = []
        begin_trials(kept, plan.marks())
    # Not when it is their turn, which may be in hours.
    for number in _missing(request, done):
        check_trial_folder(plan, out, number)
    # Workers of a cluster run in other folders.
    place = out if request.scheduler is None else out.absolute()
    scores = _run(request, partial(run_trial, plan, draw, diagnose, place), out, done, progress)
    origin = Origin(command=request.command, model=str(rig))
    moved = moved_marks(list(kept_trials(out, scores)))
    return BlindStudy(tuple(scores), plan.marks(), moved, origin=origin)


def check_shares(request: BlindRequest) -> None:
    """Raise :class:`InputError` for shares that are none, or that ask for what foreign trials do not have."""
    shares = Shares(*request.shares)
    if request.foreign and shares.two + shares.unknown > 0.0:
        raise InputError(
            "foreign trials have nothing or one effect",
            source="--shares",
            remedy="give 0 for two and for unknown, such as: --shares 30 70 0 0",
        )


def plan_of(request: BlindRequest, sheet: bytes, kept: Path) -> Plan:
    """What the trials are, with the seed of an earlier run or a secret one if none was given.

    ``sheet`` is what is in the rig file.
    """
    seed = request.seed
    if seed is None:
        kept_seed = marks_in(kept).get("seed")
        seed = kept_seed if type(kept_seed) is int and kept_seed >= 0 else secrets.randbits(32)
    return Plan(
        request.rig or default_rig_path(),
        sheet,
        seed,
        request.shares,
        request.every,
        request.sweep,
        request.foreign,
    )


def _missing(request: BlindRequest, done: Sequence[Score]) -> list[int]:
    """The numbers of the trials that are not ``done``."""
    there = {score.number for score in done}
    return [number for number in range(1, request.trials + 1) if number not in there]


def _run(
    request: BlindRequest, work: Callable[[int], Score], out: Path, done: list[Score], progress: Progress
) -> list[Score]:
    """The marks of all trials: those ``done``, and the others, each kept in ``out`` as soon as it is there."""
    scores = {score.number: score for score in done}
    missing = _missing(request, done)
    if done:
        progress(f"{len(done)} trials are there from an earlier run")
    if missing:
        progress(f"trial {missing[0]} of {request.trials}")
    with closing(side_by_side(work, missing, request.jobs, request.scheduler)) as made:
        for score in made:
            scores[score.number] = score
            append_trial(out / FILE, asdict(score))
            there = sum(number <= request.trials for number in scores)
            progress(f"{there} of {request.trials} trials done; {score}")
    return [scores[number] for number in sorted(scores) if number <= request.trials]
