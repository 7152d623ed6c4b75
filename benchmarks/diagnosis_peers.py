"""Sparse regression on blind trials, beside what the diagnosis said of the same recordings.

The peers (:mod:`benchmarks.sparse_selection`) get all that can be given to them: the residuals of the recalibrated
baseline, whitened, and for a library the columns of the diagnosis (:mod:`benchmarks.trial_regression`). Their task is
what they are made for: to find the few terms that matter. What has to be chosen for a peer, a threshold and a variant
of the regression, is chosen knowing all answers.

Trials of the catalogue's own effects and foreign trials, whose truth follows laws that no library has, are counted
apart. A peer says the name of an effect, or that nothing is missing; the rules that mark the diagnosis mark it
(:mod:`savgs_ident.validation.blind_marks`):

    own       the drawn effect by its name
    foreign   the effect's port, and its family at that port, among those that are right for the truth
    nothing   a false alarm for any name

Marks are generous where in doubt. Effects that do exactly the same are one term under all their names, and it is
right if one of them is. A term has the port and the family of its effect whatever its sign, even one that the effect
cannot have, and whatever terms are selected beside it.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.outcome import Outcome, Progress
from benchmarks.sparse_selection import PEERS, THRESHOLDS, Peer, Said
from benchmarks.trial_regression import VARIANTS, Trial, Variant, read_trial, trial_folders
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.blind_answer import Answer
from savgs_ident.validation.blind_marks import failed, score_of
from savgs_ident.validation.blind_score import Score, said_words, truth_words
from savgs_ident.validation.trials import side_by_side

Marks = Mapping[str, bool]
"""Marks of what was said of a trial, by name: those that apply to its kind."""

ALARM = "false_alarms"
RIGHT = ("top1", "port", "family")


def measure(folders: Sequence[Path], progress: Progress) -> Outcome:
    """All on the trials of one effect or none in folders that ``savgs-ident blind`` wrote."""
    places = [each for folder in folders for each in trial_folders(folder)]
    trials: list[Trial] = []
    for each in side_by_side(partial(_one_of, places), range(len(places))):
        trials.append(each)
        progress(f"sindy: {len(trials)} of {len(places)} trials")
    trials.sort(key=lambda each: places.index(each.place))
    if not trials:
        where = " ".join(str(folder) for folder in folders)
        return Outcome(
            {}, (f"sindy: no trials in {where}; `savgs-ident blind --out {folders[0]}` makes some.",)
        )
    own = compare([each for each in trials if not each.ours.foreign], "", progress)
    return own + compare([each for each in trials if each.ours.foreign], "foreign_", progress)


def _one_of(places: Sequence[Path], number: int) -> Trial:
    return read_trial(places[number])


def compare(trials: Sequence[Trial], prefix: str, progress: Progress) -> Outcome:
    """The diagnosis and its peers on trials of one kind, own or foreign; figures begin with ``prefix``."""
    if not trials:
        return Outcome()
    chosen = {name: choose(peer, trials) for name, peer in PEERS.items()}
    marks = {"ours": [marks_of([each.ours]) for each in trials]}
    marks |= {name: each.marks for name, each in chosen.items()}
    nothing = sum(each.answer.kind == "none" for each in trials)
    figures: dict[str, float] = {
        f"{prefix}trials_effects": len(trials) - nothing,
        f"{prefix}trials_nothing": nothing,
    }
    for name, each in marks.items():
        for mark, share in shares_of(each).items():
            figures[f"{prefix}{mark}_percent_{name}"] = 100.0 * share
    for number, trial in enumerate(trials):
        said = [f"{name} {each.said[number] or 'nothing'}" for name, each in chosen.items()]
        place = "/".join(trial.place.parts[-2:])
        progress(
            f"{place}: {truth_words(trial.ours)}; {'; '.join([f'ours {said_words(trial.ours)}', *said])}"
        )
    notes = [f"{prefix}{name}: {each.how}; chosen knowing all answers." for name, each in chosen.items()]
    return Outcome(figures, tuple(notes))


class Chosen(NamedTuple):
    """What a peer says of all trials, set up as suits it best.

    Attributes:
        how: it is set up, in words.
        said: of each trial.
        marks: of each trial.
    """

    how: str
    said: tuple[Said, ...]
    marks: list[Marks]


def choose(peer: Peer, trials: Sequence[Trial]) -> Chosen:
    """A peer at the variant and the threshold that suit it best."""
    tried = (each for variant in VARIANTS for each in _settings(peer, variant, trials))
    return max(tried, key=lambda each: merit(each.marks))


def _settings(peer: Peer, variant: Variant, trials: Sequence[Trial]) -> Iterable[Chosen]:
    answers = [each.answer for each in trials]
    said = list(zip(*(peer(each.regressions[variant]) for each in trials), strict=True))
    for place, each in enumerate(said):
        threshold = f", threshold {THRESHOLDS[place]:.3g}" if len(said) > 1 else ""
        marks = [marks_of(scores_of(*pair)) for pair in zip(answers, each, strict=True)]
        yield Chosen(f"{variant}{threshold}", each, marks)


def merit(marks: Sequence[Marks]) -> float:
    """What a peer is chosen by: the mean share of its right marks, less that of its false alarms."""
    shares = shares_of(marks)
    right = [shares[name] for name in RIGHT if name in shares]
    return sum(right) / max(len(right), 1) - shares.get(ALARM, 0.0)


def shares_of(marks: Sequence[Marks]) -> dict[str, float]:
    """The share of the trials that have each mark, of those to which it applies."""
    counted = {name: [each[name] for each in marks if name in each] for name in (*RIGHT, ALARM)}
    return {name: sum(each) / len(each) for name, each in counted.items() if each}


def marks_of(scores: Sequence[Score]) -> Marks:
    """The marks of a verdict, from the scores of all names that it may go by: the best counts."""
    kind = scores[0].kind
    if kind == "none":
        return {ALARM: all(each.false_alarm for each in scores)}
    if kind == "effect":
        return {"top1": any(each.said[:1] == each.effects for each in scores)}
    return {
        "port": any(bool(each.port_right) for each in scores),
        "family": any(bool(each.family_right) for each in scores),
    }


def scores_of(answer: Answer, said: Said) -> list[Score]:
    """The scores of what a peer says, one for each name of the term."""
    return [score_of(answer, _diagnosis(name)) for name in (said.split("|") if said else [None])]


def _diagnosis(name: str | None) -> dict[str, Any]:
    """What stands for the ``diagnosis.json`` of a peer that names an effect, or none."""
    blank = failed("")
    if name is None:
        return blank | {"verdict": blank["verdict"] | {"kind": "none"}}
    effect = CATALOGUE[name]
    location = effect.port.location
    verdict = {
        "kind": "effect",
        "effects": [name],
        "ports": [location],
        "families": [f"{location}/{effect.law.family.value}"],
    }
    return blank | {"verdict": blank["verdict"] | verdict}
