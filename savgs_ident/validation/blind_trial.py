"""One blind trial from the draw to its marks, on disk.

    trial_0007/
      campaign/campaign.csv.gz     all that the diagnosis gets
      campaign/seal.json           digests of answer and recordings, written before the diagnosis begins
      answer.json                  the answer and its salt, opened when the diagnosis has spoken
      diagnosis.json               what it said

The seal is written last: a folder with a seal is whole, and its recordings serve again.
"""

import json
import shutil
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from savgs_ident.core.errors import InputError, blamed_on
from savgs_ident.core.files import is_begun, prepare_folder, record_of, write_json
from savgs_ident.diagnosis.diagnose import Watch, nobody
from savgs_ident.diagnosis.public import SIMTR, diagnose_response
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig, parse_rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import Recording
from savgs_ident.simulate.compared_tests import first_sweep, measured_response
from savgs_ident.simulate.public import DWELLS
from savgs_ident.validation.blind_answer import Answer, Envelope, Seal, envelope_of, opened, sealed
from savgs_ident.validation.blind_draw import Shares, draw_answer
from savgs_ident.validation.blind_marks import failed, port_in_question, score_of, stand_in
from savgs_ident.validation.blind_score import Score
from savgs_ident.validation.foreign_draw import draw_foreign, true_bench
from savgs_ident.validation.foreign_laws import FOREIGN
from savgs_ident.validation.other_port import log_odds_of_port, log_odds_of_stand_in
from savgs_ident.validation.trials import code_version, rig_marks
from savgs_ident.validation.varied_constants import varied_into
from savgs_ident.validation.virtual_campaign import FILE, record_campaign, write_recordings
from savgs_ident.validation.virtual_rig import Bench, Programme

DRAWS = 5
"""So often a rig that does not come to a steady motion is drawn again."""

SWEEP = 60.0
"""Length of the sweep [s], where there is one."""

Parsed = TypeVar("Parsed")


@dataclass(frozen=True)
class Plan:
    """What the trials of a run have in common.

    Attributes:
        rig: file of the rig's sheet, by which it is called.
        sheet: what was in it when the run began.
        seed: of everything that is drawn.
        shares: how often which kind of trial is drawn.
        every: so many dwells of the programme are left out between two.
        sweep: whether a sweep is recorded.
        foreign: whether effects follow laws that the diagnosis does not have, on rigs with small errors.
    """

    rig: Path
    sheet: bytes
    seed: int
    shares: tuple[float, float, float, float]
    every: int
    sweep: bool
    foreign: bool = False

    def marks(self) -> dict[str, Any]:
        """What trials must have in common to be counted together, as JSON has it."""
        marks = {
            "rig": str(self.rig),
            **rig_marks(self.sheet),
            "seed": self.seed,
            "shares": list(self.shares),
            "every": self.every,
            "sweep": self.sweep,
        }
        return marks | {"foreign": True} if self.foreign else marks

    def bench(self) -> Bench:
        """The rig and what it is put through."""
        programme = Programme(
            dwells=DWELLS[(len(DWELLS) - 1) % self.every :: self.every], sweep=SWEEP if self.sweep else 0.0
        )
        return Bench(parse_rig(self.sheet, self.rig), SIMTR.baseline, SIMTR.free, programme)


@dataclass(frozen=True)
class Drawn:
    """A rig that was drawn: the truth, a salt for its seal (hexadecimal), and its campaign."""

    answer: Answer
    salt: str
    recordings: tuple[Recording, ...]


@dataclass(frozen=True)
class Question:
    """What goes with the recordings: the seal, and what the catalogue of this trial lacks."""

    without: tuple[str, ...]
    seal: Seal


Draw = Callable[[Plan, Bench, int], Drawn]
"""The rig of the trial with a number; always the same."""

Diagnose = Callable[[Path, Rig, tuple[str, ...]], Mapping[str, Any]]
"""From a campaign's folder, the rig's sheet and effects to leave out to the object of ``diagnosis.json``."""


def check_trial_folder(plan: Plan, out: Path, number: int) -> None:
    """Raise :class:`InputError` if a trial is to be recorded in a folder that holds what is not a trial's."""
    folder = _folder(out, number)
    if _is_recorded(folder, plan, number):
        return
    campaign = folder / "campaign"
    strange = _strange(folder, ("answer.json", "diagnosis.json"))
    if campaign in strange and campaign.is_dir():
        strange.remove(campaign)
        strange += _strange(campaign, ("seal.json", FILE))
    if strange:
        raise InputError(
            f"holds {strange[0].relative_to(folder)}, which is not of a trial",
            source=folder,
            remedy="name another --out DIR, or move the folder away",
        )


def record_trial(plan: Plan, draw: Draw, out: Path, number: int) -> Path:
    """Draw a trial and record it, unless its folder holds that already; the folder."""
    folder = prepare_folder(_folder(out, number))
    if not _is_recorded(folder, plan, number):
        drawn = draw(plan, plan.bench(), number)
        check_trial_folder(plan, out, number)
        _record(folder, plan, drawn, number)
    return folder


def run_trial(plan: Plan, draw: Draw, diagnose: Diagnose, out: Path, number: int) -> Score:
    """The marks of a trial: drawn and recorded unless its folder holds that already, diagnosed, opened."""
    folder = record_trial(plan, draw, out, number)
    campaign = folder / "campaign"
    rig = parse_rig(plan.sheet, plan.rig)
    found = _diagnosed(diagnose, campaign, rig, _question(folder).without)
    write_json(folder / "diagnosis.json", found)
    seal = _question(folder).seal
    envelope = _read(folder / "answer.json", envelope_of)
    with blamed_on(campaign / "seal.json"):
        answer = opened(seal, envelope, load_campaign(campaign).sha256)
    return score_of(answer, found, code_version(), _elsewhere(answer, found, campaign, rig))


def _elsewhere(answer: Answer, found: Mapping[str, Any], campaign: Path, rig: Rig) -> float | None:
    """Log odds of the drawn law against it at the port in question, or against its stand-in; None without both."""
    other, instead = port_in_question(answer, found), stand_in(answer, found)
    if other is None and instead is None:
        return None
    name = answer.effects[0]
    drawn = FOREIGN[name].effect if answer.kind == "foreign" else CATALOGUE[name]
    measured = measured_response(load_campaign(campaign), QuarterCar, SIMTR.orders)
    try:
        if instead is not None:
            return log_odds_of_stand_in(measured, rig, drawn, instead, SIMTR)
        return None if other is None else log_odds_of_port(measured, rig, drawn, other, SIMTR)
    except InputError:
        # A baseline without a solution says nothing of the ports: the trial has its strict marks.
        return None


def diagnose_folder(
    folder: Path,
    rig: Rig,
    without: tuple[str, ...],
    watch: Watch = nobody,
    constants: DecisionConstants = DEFAULTS,
) -> Mapping[str, Any]:
    """The diagnosis of a recorded campaign as its ``diagnosis.json`` has it."""
    settings = replace(SIMTR, without=without, constants=constants)
    campaign = load_campaign(folder)
    measured = measured_response(campaign, QuarterCar, settings.orders)
    sweep, _ = first_sweep(campaign, QuarterCar)
    origin = RigModel(rig, settings.baseline).origin(campaign, measured.warnings)
    diagnosis = diagnose_response(measured, rig, settings, sweep=sweep, watch=watch, origin=origin)
    record: Mapping[str, Any] = json.loads(diagnosis.to_json())
    return record


def diagnose_by_other_constants(folder: Path, rig: Rig, without: tuple[str, ...]) -> Mapping[str, Any]:
    """The same, with the verdicts by decision constants halved and doubled."""
    varied: dict[str, Any] = {}
    return {**diagnose_folder(folder, rig, without, varied_into(varied)), **varied}


def kept_trials(out: Path, scores: Sequence[Score]) -> Iterator[tuple[Score, Answer, Mapping[str, Any]]]:
    """Trials that are done and whose files are still there: marks, answer, and what the diagnosis said."""
    for score in scores:
        answer, said = (_folder(out, score.number) / name for name in ("answer.json", "diagnosis.json"))
        # Files that were moved or damaged since do not take the marks with them.
        with suppress(OSError, InputError):
            yield score, _read(answer, envelope_of).answer, _read(said, dict)


def marked_anew(out: Path, scores: Sequence[Score]) -> list[Score]:
    """The marks of trials by the rules of today; those that were kept, where a trial's files are gone or damaged."""
    anew = {}
    for score, answer, said in kept_trials(out, scores):
        with suppress(KeyError, TypeError, AttributeError):
            anew[score.number] = score_of(answer, said, score.version, score.elsewhere)
    return [anew.get(score.number, score) for score in scores]


def _diagnosed(diagnose: Diagnose, folder: Path, rig: Rig, without: tuple[str, ...]) -> Mapping[str, Any]:
    try:
        return diagnose(folder, rig, without)
    except OSError:
        # A disk that is full says nothing of the diagnosis.
        raise
    except Exception as error:
        # A diagnosis that breaks is one that is not right; the other trials go on.
        return failed(f"{type(error).__name__}: {error}", traceback.format_exc())


def draw_and_record(plan: Plan, bench: Bench, number: int) -> Drawn:
    """A rig drawn in secret, and its campaign by the transient simulator.

    Raises :class:`InputError` if none that can be assessed, or none that comes to a steady motion, is found.
    """
    for attempt in range(DRAWS):
        random = np.random.default_rng((plan.seed, number, attempt))
        if plan.foreign:
            answer = draw_foreign(bench, Shares(*plan.shares), number, random)
        else:
            answer = draw_answer(bench, Shares(*plan.shares), number, random)
        try:
            recordings = record_campaign(true_bench(bench, answer), answer, random)
        except InputError:
            continue
        return Drawn(answer, random.bytes(16).hex(), recordings)
    raise InputError(
        f"no rig that comes to a steady motion was drawn in {DRAWS} attempts",
        source=f"trial {number}",
        remedy="name another --seed",
    )


def _record(folder: Path, plan: Plan, drawn: Drawn, number: int) -> None:
    """Write the campaign, the answer, and last the seal, in the place of what is there."""
    shutil.rmtree(folder)
    campaign = prepare_folder(folder / "campaign")
    write_recordings(drawn.recordings, campaign)
    envelope = Envelope(drawn.answer, drawn.salt)
    settings = {"trial": number, "settings": plan.marks()}
    write_json(folder / "answer.json", settings | asdict(envelope))
    seal = sealed(envelope, load_campaign(campaign).sha256)
    # What the catalogue of this trial lacks is part of the question.
    write_json(campaign / "seal.json", {"without": drawn.answer.without, "seal": asdict(seal)})


def _is_recorded(folder: Path, plan: Plan, number: int) -> bool:
    """Whether the folder holds the sealed recordings of this trial."""
    campaign = folder / "campaign"
    whole = all(path.is_file() for path in (campaign / "seal.json", campaign / FILE, folder / "answer.json"))
    if not whole:
        return False
    known = _read(folder / "answer.json", lambda record: (record.get("trial"), record.get("settings")))
    return known == (number, plan.marks())


def _folder(out: Path, number: int) -> Path:
    return out / f"trial_{number:04d}"


def _strange(folder: Path, names: Sequence[str]) -> list[Path]:
    """What is in a folder besides files with these names, whole or begun; nothing where there is no folder."""
    found = sorted(folder.iterdir()) if folder.is_dir() else []
    return [
        each for each in found if not (each.is_file() and (each.name in names or is_begun(each.name, names)))
    ]


def _question(folder: Path) -> Question:
    return _read(folder / "campaign" / "seal.json", partial(record_of, Question))


def _read(path: Path, parse: Callable[[dict[str, Any]], Parsed]) -> Parsed:
    """What ``parse`` makes of the JSON object in a file of the trial."""
    try:
        record = json.loads(path.read_text("utf-8"))
        if not isinstance(record, dict):
            raise ValueError("it is no table")
        return parse(record)
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"is not what a trial leaves behind: {error}",
            source=path,
            remedy="remove the trial's folder to record it again",
        ) from error
